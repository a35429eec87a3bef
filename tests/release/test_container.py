"""The steps of the Containerfile, carried out in an empty Debian, where no container engine is needed."""

import json
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from swarmwire.comms.base.clock import WallClock, to_s
from tests.release.built import ROOT

CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")  # of this machine, whose network may have its own authority
COPIED = "/machine.crt"  # where an image has them, apart from its own
PASSED_ON = ("HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY", "http_proxy", "https_proxy", "no_proxy")
USER_ID = 1000
# What podman gives root in a container by default; docker adds mknod, net_raw and audit_write.
FILE_CAPABILITIES = ["chown", "dac_override", "fowner", "fsetid", "setfcap"]
CAPABILITIES = [*FILE_CAPABILITIES, "kill", "setgid", "setuid", "setpcap", "net_bind_service", "sys_chroot"]
PAGE = ROOT / "docs" / "library.md"  # its command for robots with interfaces adds some

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(3000),
    pytest.mark.skipif(shutil.which("debootstrap") is None or os.getuid() != 0, reason="needs debootstrap, and root"),
]


def steps() -> list[tuple[str, list[str]]]:
    """The instructions of the Containerfile with their words; those of RUN are one word."""
    text = re.sub(r"\\\n", " ", (ROOT / "Containerfile").read_text())
    lines = [line.partition(" ") for line in text.splitlines() if line and not line.startswith("#")]
    readers = {"RUN": lambda arguments: [arguments], "ENTRYPOINT": json.loads, "CMD": json.loads}
    return [(name, readers.get(name, shlex.split)(arguments)) for name, _, arguments in lines]


class Stage:
    """A root that a FROM begins, and what the instructions after it have set."""

    def __init__(self, root: Path, base: Path) -> None:
        subprocess.run(["cp", "-a", base, root], check=True)
        self.root, self.folder, self.user, self.entry = root, "/", "root", list[str]()
        self.variables = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root"}
        self.variables |= {"SSL_CERT_FILE": COPIED, "PIP_CERT": COPIED}
        self.variables |= {name: os.environ[name] for name in PASSED_ON if name in os.environ}

    def build(self, line: str) -> str:
        """What a line of a RUN prints."""
        return self._inside([], "mount -t proc proc proc", line)

    def run(self, *words: str, capabilities: Sequence[str] = (), then: str = "true") -> str:
        """What the entry point prints with these words, as an engine would start it, and `then`, a line after it.

        `capabilities` are those of root; without them the user of the image runs it, who has none.
        """
        mounts = "mount -t proc proc proc && mount --bind proc/sys proc/sys && mount -o remount,bind,ro proc/sys"
        mounts += " && mount -t sysfs -o ro sysfs sys && ip link set lo up"
        limit = "--bounding-set=-all" + "".join(f",+{name}" for name in capabilities)
        identity = [] if capabilities else [f"--reuid={USER_ID}", f"--regid={USER_ID}", "--clear-groups"]
        line = f"{shlex.join([*self.entry, *words])} && {then}"
        limited = shlex.join(["setpriv", limit, "--inh-caps=-all", *identity, "sh", "-c", line])
        return self._inside(["--net", "--ipc", "--uts"], mounts, limited)

    def copy(self, words: list[str], stages: dict[str, "Stage"]) -> None:
        """COPY, of the clone or of another stage."""
        *options, source, target = words
        settings = dict(option.removeprefix("--").split("=") for option in options)
        path = self.root / target.removeprefix("/")
        if "from" in settings:
            subprocess.run(["cp", "-a", stages[settings["from"]].root / source.removeprefix("/"), path], check=True)
        else:
            names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
            for name in filter(None, names.decode().split("\0")):
                (path / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, path / name)
        if "chown" in settings:
            self.build(f"chown -R {settings['chown']} {target}")

    def _inside(self, namespaces: list[str], mounts: str, line: str) -> str:
        """What a line prints below the root, in namespaces of its own; it must end well."""
        enter = f"mount --bind {self.root} {self.root} && cd {self.root} && mount --rbind /dev dev && {mounts}"
        enter += f" && pivot_root . . && umount -l . && cd {self.folder} && {line}"
        command = ["unshare", "--mount", "--pid", "--fork", "--kill-child", *namespaces, "sh", "-c", enter]
        done = subprocess.run(command, env=self.variables, capture_output=True, text=True, check=False, timeout=2000)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        return done.stdout + done.stderr


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    """The last stage of the Containerfile, with a scenario in the folder where it starts."""
    folder = tmp_path_factory.mktemp("image")
    base = folder / "base"
    suite = re.search(r"debian:(\w+)-slim", (ROOT / "Containerfile").read_text())
    command = ["debootstrap", "--variant=minbase", suite[1], base]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode:
        pytest.skip(f"no Debian is to be had: {made.stdout.splitlines()[-1]}")
    shutil.copy(CERTIFICATES, base / COPIED.removeprefix("/"))
    shutil.copy("/etc/resolv.conf", base / "etc" / "resolv.conf")
    stages = dict[str, Stage]()
    for name, words in steps():
        if name == "FROM":
            stages[words[-1]] = Stage(folder / f"stage-{len(stages)}", base)
        stage = list(stages.values())[-1]
        if name == "RUN":
            stage.build(words[0])
        elif name == "COPY":
            stage.copy(words, stages)
        elif name == "WORKDIR":
            stage.folder = words[0]
        elif name in ("ENV", "ARG"):
            stage.variables |= dict(word.split("=", 1) for word in words)
        elif name == "USER":
            stage.user, stage.variables["HOME"] = words[0], f"/home/{words[0]}"
        elif name == "ENTRYPOINT":
            stage.entry = words
    last = list(stages.values())[-1]
    shutil.copy(ROOT / "scenarios" / "flocking-lossy.toml", last.root / last.folder.removeprefix("/"))
    return last


def compiled(image: Stage) -> set[Path]:
    return set((image.root / image.variables["NUMBA_CACHE_DIR"].removeprefix("/")).rglob("*.nbc"))


def test_image_runs_its_scenario_as_its_user_and_compiles_nothing(image):
    before = compiled(image)
    size = subprocess.run(["du", "-sm", image.root], capture_output=True, text=True, check=True).stdout.split()[0]
    clock = WallClock()
    start_ns = clock.now_ns()
    printed = image.run("run", "flocking-lossy.toml", "--out", "first")
    print(f"{size} MB, {len(before)} functions, the first run took {to_s(clock.now_ns() - start_ns):.1f} s")
    assert "written: first" in printed
    assert before
    assert compiled(image) == before
    assert (image.root / "home" / "swarm" / "first" / "summary.json").stat().st_uid == USER_ID


def test_image_with_the_stated_capabilities_gives_robots_interfaces(image):
    settings = {"radio.interface": "{}", "radio.range_m": "20.0", "radio.loss": "0.0", "duration_s": "8"}
    settings["robots.flock.program"] = '["ping", "-c", "1", "-w", "7", "flock-1"]'
    options = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    run = ("run", "flocking-lossy.toml", *options, "--realtime", "1", "--out", "robots")
    added = [name.lower() for name in re.findall(r"--cap-add (\w+)", PAGE.read_text())]
    printed = image.run(*run, capabilities=[*CAPABILITIES, *added], then="cat robots/programs/flock-0.log")
    assert "1 packets transmitted, 1 received" in printed
