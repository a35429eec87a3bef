"""What earlier versions wrote, and this one, is read by all that reads its like, or refused in one line.

The records are real ones, made by the versions in whose time each format was written (`records/README.md`).
"""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import read_campaign
from swarmwire.deploy.certificates.register import Register
from swarmwire.deploy.record.inputs import recorded_inputs
from swarmwire.deploy.record.interventions import read_interventions
from swarmwire.deploy.record.origin import read_origin
from swarmwire.deploy.tuning.study_file import StudyFile
from swarmwire.deploy.tuning.tuning import read_tuning
from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.real_log.real_logs import read_real_logs
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.verify.finding import State
from swarmwire.metrics.verify.verify import verify
from tests.support.deploy.commands import called

RECORDS = Path(__file__).parent / "records"
RUNS = ("run-2", "run-2-frames-1", "run-2-frames-2")
CAMPAIGNS = ("campaign-1-first", "campaign-1")
TUNINGS = ("tuning-1-first", "tuning-1")
TABLES = ("ticks", "packets", "events", "radio_robots", "radio_distances")
END = (0, None)  # exit codes of a command that ended well
OLDER = "static.json: format: expected 2, got 1: made by an older swarmwire; that one reads it"


Typed = Callable[..., tuple[object, str]]  # a command -> its exit code, and all it said, on one line


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Typed:
    def call(*arguments: str | Path) -> tuple[object, str]:
        code, out, errors = called(monkeypatch, capsys, *arguments)
        return code, " ".join(f"{out} {errors}".split())

    return call


def copied(name: str, folder: Path) -> Path:
    return shutil.copytree(RECORDS / name, folder / name)


@pytest.mark.parametrize("name", RUNS)
def test_a_run_is_read_whole(name: str) -> None:
    folder, findings = RunFolder(RECORDS / name), verify(RECORDS / name)
    assert folder.summary is not None
    assert {finding.state for finding in findings} <= {State.WHOLE, State.NOT_RECORDED}
    assert folder.static.robot_names[0] == "flock-0"
    assert folder.summary["ticks"] == len(folder.ticks()) == 10
    assert all(getattr(folder, table)().width > 5 for table in TABLES)
    assert len(folder.robots()) == 30


@pytest.mark.parametrize("name", [RUNS[0], RUNS[-1]])
def test_a_run_can_be_drawn_told_and_captured(name: str, typed: Typed, tmp_path: Path) -> None:
    run = copied(name, tmp_path)
    for command in (("report", run), ("export", run), ("export", run, "--pdr", "--to", tmp_path / "pdr.png")):
        assert typed(*command)[0] in END
    assert typed("export", run, "--to", tmp_path / "traffic.pcapng")[0] in END


@pytest.mark.parametrize("name", RUNS)
def test_a_run_has_what_it_needs_to_be_repeated(name: str) -> None:
    """Whether it then comes out the same is up to versions and CPU, and no test's affair."""
    origin, inputs = read_origin(RECORDS / name), recorded_inputs(RECORDS / name)
    assert (origin.ticks, origin.seeds) == (10, (5,))
    assert (inputs is not None) == ("frames" in name)
    if inputs is not None:
        assert inputs.end_tick == 10
        assert all(len(inputs.actions(tick, 3).rows) <= 3 for tick in range(inputs.first_tick, 10))


def test_what_people_did_to_a_run_is_read() -> None:
    given, sha256 = read_interventions(RECORDS / "run-2-frames-2")
    assert sha256
    assert [(done.tick, (done.table or {}).get("do")) for done in given] == [(3, "blackout")]


READERS: dict[str, Callable[[Path], object]] = {
    "static": lambda run: RunFolder(run).static,
    "ticks": lambda run: RunFolder(run).ticks(),
    "packets": lambda run: RunFolder(run).packets(),
    "robots": lambda run: RunFolder(run).robots(),
}


@pytest.mark.parametrize("reader", READERS)
def test_a_run_from_before_contracts_is_refused_in_one_line(reader: str) -> None:
    with pytest.raises(BadInput) as caught:
        READERS[reader](RECORDS / "run-1")
    assert str(caught.value) == f"{RECORDS / 'run-1'}/{OLDER}"


@pytest.mark.parametrize("command", ["report", "export", "verify"])
def test_commands_refuse_it_in_that_line(command: str, typed: Typed) -> None:
    code, said = typed(command, RECORDS / "run-1")
    assert code == (1 if command == "verify" else 2)
    assert "expected 2, got 1: made by an older" in said
    assert "Traceback" not in said


def test_the_summary_of_such_a_run_is_read_still() -> None:
    summary = RunFolder(RECORDS / "run-1").summary
    assert summary is not None
    assert (summary["ended"], summary["ticks"]) == ("duration", 10)


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_campaign_is_read_compared_told_and_could_go_on(name: str, typed: Typed, tmp_path: Path) -> None:
    campaign = CampaignFolder(RECORDS / name)
    assert campaign.finished
    assert len(campaign.runs) == 4
    assert read_campaign(RECORDS / name).runs == 4
    assert typed("report", copied(name, tmp_path), "--outcome", "order")[0] in END
    assert typed("compare", RECORDS / name, RECORDS / "campaign-1", "--outcome", "order")[0] in END


@pytest.mark.parametrize(("name", "command"), [*((of, "sweep") for of in CAMPAIGNS), *((of, "tune") for of in TUNINGS)])
def test_other_code_does_not_go_on_with_it_unasked(name: str, command: str, typed: Typed, tmp_path: Path) -> None:
    code, said = typed(command, "--resume", copied(name, tmp_path))
    assert code == 2
    assert "runs would not be comparable; --anyway goes on all the same" in said


@pytest.mark.parametrize("name", TUNINGS)
def test_a_tuning_is_read_with_its_trials(name: str, tmp_path: Path) -> None:
    folder = copied(name, tmp_path)
    tuning = read_tuning(folder)
    assert tuning.goal.outcome.column == "order.final"
    assert [trial.state for trial in StudyFile(folder, tuning).trials()] == ["complete"] * 3


def test_logs_of_robots_are_read() -> None:
    logs = read_real_logs(RECORDS / "robots-1")
    assert logs.names == ("flock-0", "flock-1")


def test_the_register_of_certificates_is_read() -> None:
    register = Register.read(RECORDS / "certificates-1")
    assert [of.name for of in register.certificates] == ["robot-1"]
