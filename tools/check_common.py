"""What the house-rule checks share: which files there are, and how a check reports and ends."""

import argparse
import pathlib
import subprocess
import sys

SOURCE_SUFFIXES = (".cpp", ".hpp")


def arguments(description):
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--root", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent.parent,
                        help="the tree to check (default: this repository)")
    return parser


def project_files(root):
    """Paths relative to root of the files under version control, or of all files when root is no git checkout."""
    git = subprocess.run(["git", "-C", str(root), "rev-parse", "--show-toplevel"], capture_output=True, text=True,
                         check=False)
    if git.returncode == 0 and pathlib.Path(git.stdout.strip()).resolve() == root.resolve():
        listed = subprocess.run(["git", "-C", str(root), "ls-files", "-z"], capture_output=True, text=True, check=True)
        paths = [pathlib.Path(name) for name in listed.stdout.split("\0") if name]
    else:
        paths = [path.relative_to(root) for path in root.rglob("*") if path.is_file()]
    # A file can be deleted in the work tree and still be listed.
    return sorted(path for path in paths if (root / path).is_file() and path.parts[0] not in ("build", "out"))


def sources(root):
    return [path for path in project_files(root) if path.suffix in SOURCE_SUFFIXES]


def finish(problems, checked):
    """Prints every problem and ends the program: 0 without problems, 1 with. A check that saw nothing fails too."""
    for problem in problems:
        print(problem)
    if checked == 0:
        print("nothing to check was found; is --root right?")
        sys.exit(1)
    print(f"{checked} files checked, {len(problems)} problems")
    sys.exit(1 if problems else 0)
