"""The installed copy of the service: unit, users, device rules and configuration, as `cmake --install` puts them down.

usage: service_test.py CASE BUILD_DIR BINDIR SYSCONFDIR. Exit code 77: skipped, systemd's tools are not there.
"""

import configparser
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77
MOST_EXPOSURE = 20  # tenths
CASE, BUILD, BINDIR, SYSCONFDIR = sys.argv[1:5]


def run(*command, **environment):
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **environment})
    print("$", *command)
    print(done.stdout + done.stderr, end="")
    return done


def need(program):
    if shutil.which(program) is None:
        print(f"SKIPPED: {program} is not installed")
        sys.exit(SKIPPED)


def below(stage, absolute):
    return stage / str(absolute).lstrip("/")


def install(stage):
    """An installed copy below stage."""
    done = run("cmake", "--install", BUILD, "--component", "service", DESTDIR=str(stage))
    assert done.returncode == 0
    # The program itself: what this build made, or any executable, so that the unit can be judged without it.
    program = below(stage, BINDIR) / "rosid"
    program.parent.mkdir(parents=True, exist_ok=True)
    built = pathlib.Path(BUILD) / "daemon" / "rosid"
    shutil.copy(built if built.exists() else "/bin/true", program)


def find(stage, name):
    found = list(stage.rglob(name))
    assert len(found) == 1, (name, found)
    return found[0]


def case_files(stage):
    install(stage)
    installed = {str(path.relative_to(stage)) for path in stage.rglob("*") if path.is_file()}
    for name in ("rosid/rosid.toml", "lib/systemd/system/rosid.service", "lib/sysusers.d/rosid.conf",
                 "lib/udev/rules.d/60-rosid.rules"):
        assert any(path.endswith("/" + name) for path in installed), (name, installed)
    config = below(stage, SYSCONFDIR) / "rosid/rosid.toml"
    config.write_text("# mine\n", encoding="utf-8")
    install(stage)
    assert config.read_text(encoding="utf-8") == "# mine\n", "an installed configuration was overwritten"


def case_verify(stage):
    need("systemd-analyze")
    install(stage)
    unit = find(stage, "rosid.service")
    # The unit names absolute paths and verify looks them up on this machine, so the copy gets the staged program.
    text = unit.read_text(encoding="utf-8")
    assert f"ExecStart={BINDIR}/rosid --config {SYSCONFDIR}/rosid/rosid.toml" in text
    unit.write_text(text.replace(f"ExecStart={BINDIR}", f"ExecStart={below(stage, BINDIR)}"), encoding="utf-8")
    done = run("systemd-analyze", "verify", "--man=no", unit)
    complaints = [line for line in (done.stdout + done.stderr).splitlines() if "rosid" in line]
    assert done.returncode == 0 and not complaints, complaints
    # verify must be able to fail here, or the lines above prove nothing.
    below(stage, BINDIR).joinpath("rosid").unlink()
    assert run("systemd-analyze", "verify", "--man=no", unit).returncode != 0


def case_security(stage):
    need("systemd-analyze")
    install(stage)
    unit = find(stage, "rosid.service")
    done = run("systemd-analyze", "security", "--offline=true", f"--threshold={MOST_EXPOSURE}", "--no-pager", unit)
    assert done.returncode == 0, "the sandbox is weaker than it was"
    done = run("systemd-analyze", "security", "--offline=true", "--threshold=5", "--no-pager", unit)
    assert done.returncode != 0, "the threshold has no effect"


def case_users(stage):
    need("systemd-sysusers")
    install(stage)
    (stage / "etc").mkdir(exist_ok=True)
    done = run("systemd-sysusers", f"--root={stage}", find(stage, "rosid.conf"))
    assert done.returncode == 0
    assert re.search(r"^rosid:", (stage / "etc/passwd").read_text(encoding="utf-8"), re.MULTILINE)
    groups = dict(line.split(":", 1) for line in (stage / "etc/group").read_text(encoding="utf-8").splitlines())
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    unit.read(find(stage, "rosid.service"))
    wanted = unit["Service"]["SupplementaryGroups"].split() + [unit["Service"]["Group"]]
    rules = find(stage, "60-rosid.rules").read_text(encoding="utf-8")
    wanted += re.findall(r'GROUP="([^"]+)"', rules)
    assert [name for name in wanted if name not in groups] == [], "a group nobody creates"


def case_rules(stage):
    install(stage)
    rules = find(stage, "60-rosid.rules").read_text(encoding="utf-8")
    match = r'(ACTION|SUBSYSTEMS?|KERNELS?|DRIVERS?|ATTRS?\{[^}]+\}|ENV\{[^}]+\})(==|!=)"[^"]*"'
    assign = r'(SYMLINK\+=|GROUP=|MODE=|TAG\+=|ATTR\{[^}]+\}=|ENV\{[^}]+\}=)"[^"]*"'
    lines = [line for line in rules.splitlines() if line and not line.startswith("#")]
    assert lines
    for line in lines:
        assert re.fullmatch(rf"({match}, )+({assign}(, |$))+", line), line
    device = re.search(r'^device = "/dev/([^"]+)"', (below(stage, SYSCONFDIR) / "rosid/rosid.toml").read_text(encoding="utf-8"),
                       re.MULTILINE)
    assert device and f'SYMLINK+="{device.group(1)}"' in rules, "the configured laser has no rule"


def main():
    with tempfile.TemporaryDirectory() as folder:
        stage = pathlib.Path(folder) / "stage"
        stage.mkdir()
        globals()[f"case_{CASE}"](stage)
    print("passed")


if __name__ == "__main__":
    main()
