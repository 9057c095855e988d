#!/usr/bin/env bash
# Stands before the compiler in the preset 'tidy': `check_source.sh PLUGIN BUILD_DIR COMPILER ARGUMENTS...`. Instead of
# compiling a source it lets clang-tidy-19 check it; the compiler only preprocesses, for the list of headers by which
# Ninja knows what to check again. The object is an empty file. What lies in BUILD_DIR is generated and not checked.
set -euo pipefail
plugin=$1 build=$2 compiler=$3
shift 3

case " $* " in *" -emit-pch "*) exec "$compiler" "$@" ;; esac

source=${*: -1} arguments=() object=
while (($#)); do
  if [[ $1 == -o ]]; then
    object=$2
    shift
  elif [[ $1 != -c ]]; then
    arguments+=("$1")
  fi
  shift
done

if [[ $source != "$build"/* ]]; then
  load=()
  if [[ -e $plugin ]]; then load=("--load=$plugin"); fi
  clang-tidy-19 --quiet "${load[@]}" "$source" -- "$compiler" "${arguments[@]}" 2> >(grep -v 'warnings\? generated' >&2)
fi
"$compiler" "${arguments[@]}" -E -o /dev/null
: >"$object"
