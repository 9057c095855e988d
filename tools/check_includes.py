#!/usr/bin/env python3
"""Which folder may include what (docs/architecture.md, "Folders").

The rules are the two tables below. A line is excused by nothing: a rule that is wrong is changed here, in sight of
everybody.
"""

import re
import sys

import check_common

# Folder: the project folders it may include besides itself. The longest matching entry counts.
MAY_INCLUDE = {
    "base": (),
    "hal": ("base",),
    "estimator": ("base",),
    "mapping": ("base",),
    "config": ("base", "hal/config.hpp", "estimator/config.hpp", "mapping/config.hpp"),
    "msgs": ("base", "hal", "estimator", "mapping"),
    "daemon": ("base", "hal", "estimator", "mapping", "config", "msgs"),
    "sim": ("base", "hal", "config", "msgs"),
    "tools": ("*",),
    "tests": ("*",),
    "bench": ("*",),
    "cmake": (),
}

# Header (regular expression on the name between the brackets): the places that may include it; all others must not.
# A place is a folder, or a file by the start of its name.
RESERVED_HEADERS = {
    r"sys/|linux/|net/|arpa/|netinet/|(unistd|fcntl|poll|termios|pthread|sched|signal|dlfcn|ifaddrs|pty|asm/.*)\.h$":
        ("hal/io", "daemon", "msgs/atomic_file", "sim/pty", "sim/can_socket", "tools", "tests", "bench"),
    r"systemd/": ("daemon", "tests"),
    r"lcm/": ("daemon", "msgs", "tools", "tests"),
    r"toml\+\+/": ("config/toml", "tests"),
    r"polyclipping/": ("mapping/polygon", "tests"),
    r"embree[34]/": ("sim/ray_caster", "sim/scene"),
    r"png\.h$": ("tools",),
    r"nlohmann/": ("daemon/run_record", "tools", "tests", "bench"),
    r"CLI/": ("daemon/main", "tools", "bench"),
    r"(gpiod|libusb-1\.0/.*|libusb|ftdi|libftdi1/.*)\.h(pp)?$": ("hal/io", "tests"),
    r"libsocketcan\.h$": ("tools/doctor/can_controller",),
    r"gtest/|gmock/|rapidcheck": ("tests",),
    r"benchmark/": ("bench",),
}

# No clock, no thread, no log, no file: results depend on the arguments alone.
PURE = ("base", "hal", "estimator", "mapping")
NOT_PURE = ("hal/io",)
IMPURE_HEADERS = re.compile(
    r"(thread|mutex|shared_mutex|condition_variable|future|semaphore|barrier|latch|stop_token|iostream|fstream|syncstream|"
    r"filesystem|ctime|time\.h|stdio\.h)$")
IMPURE_CODE = {
    r"::now\s*\(": "reads a clock",
    r"\b(clock_gettime|gettimeofday|nanosleep|sleep_for|sleep_until)\b": "reads a clock or waits",
    r"\brandom_device\b": "is random in earnest",
    r"\b(std::)?(printf|fprintf|puts|cout|cerr|clog)\b": "writes to a stream",
    r"\bgetenv\b": "reads the environment",
}
EXCUSED = {"base/contract.cpp": "a broken contract prints before it aborts"}
# Reproducible by construction as well, though they read files.
NO_CLOCK = ("config", "msgs")

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
LINE_COMMENT = re.compile(r"//.*$")
STRING = re.compile(r'"(?:[^"\\]|\\.)*"')


def is_in(path, places):
    return any(path == place or path.startswith(place + "/") or (place != "" and "/" in place and path.startswith(place))
               for place in places)


def check_project_include(path, name, root):
    folder = path.split("/")[0]
    target = name.split("/")[0]
    if folder == "tests" and any((base / name).is_file() for base in (root / "tests", (root / path).parent)):
        return None
    if target not in MAY_INCLUDE:
        return None if (root / name).is_file() else f'"{name}" is not a path from the root of the repository'
    # NAME.in: CMake makes NAME of it.
    if not (root / name).is_file() and not (root / (name + ".in")).is_file():
        return f'"{name}" does not exist'
    allowed = MAY_INCLUDE[folder]
    if target == folder or "*" in allowed or is_in(name, allowed):
        return None
    return f'{folder} must not include "{name}" (allowed: {", ".join(allowed) or "itself only"})'


def check_system_include(path, name):
    for pattern, places in RESERVED_HEADERS.items():
        if re.match(pattern, name) and not is_in(path, places):
            return f"<{name}> belongs to {', '.join(places)}"
    if is_in(path, PURE) and not is_in(path, NOT_PURE) and IMPURE_HEADERS.match(name):
        return f"<{name}>: this folder is pure (no clock, no thread, no log, no file)"
    return None


def impure_code(path, line):
    code = STRING.sub('""', LINE_COMMENT.sub("", line))
    if is_in(path, PURE) and not is_in(path, NOT_PURE):
        patterns = IMPURE_CODE
    elif is_in(path, NO_CLOCK):
        patterns = {pattern: why for pattern, why in IMPURE_CODE.items() if "clock" in why}
    else:
        return None
    for pattern, why in patterns.items():
        found = re.search(pattern, code)
        if found:
            return f"'{found.group(0).strip()}' {why}: this folder must not"
    return None


def check_file(root, relative):
    path = relative.as_posix()
    problems = []
    for number, line in enumerate((root / relative).read_text(encoding="utf-8").splitlines(), start=1):
        include = INCLUDE.match(line)
        if include and include.group(1) == '"':
            problem = check_project_include(path, include.group(2), root)
        elif include:
            problem = check_system_include(path, include.group(2))
        else:
            problem = None if path in EXCUSED else impure_code(path, line)
        if problem:
            problems.append(f"{path}:{number}: {problem}")
    return problems


def main():
    options = check_common.arguments(__doc__).parse_args()
    problems = []
    checked = 0
    for relative in check_common.sources(options.root):
        if relative.parts[0] not in MAY_INCLUDE:
            problems.append(f"{relative.as_posix()}: unknown folder '{relative.parts[0]}', give it a rule in {sys.argv[0]}")
            continue
        checked += 1
        problems += check_file(options.root, relative)
    check_common.finish(problems, checked)


if __name__ == "__main__":
    main()
