"""What a run says of its radio, under every preset: tables, a picture, and the same in every layout."""

import pytest
from polars.testing import assert_frame_equal
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.deploy import Recording, RunFolder, run
from swarmwire.deploy.cli.app import app
from swarmwire.metrics.run_folder.verify import verify
from tests.support.deploy.runs import LOSSY, ROOT, run_spread

SIGNALS = ROOT / "scenarios" / "flocking-802154.toml"
JAMMED = ROOT / "scenarios" / "jammed.toml"
TABLES = ("radio_robots", "radio_distances", "radio_links")


@pytest.mark.parametrize("scenario", [LOSSY, SIGNALS], ids=lambda path: path.stem)
def test_tables_of_the_radio_are_alike_in_one_process_and_in_many_and_agree_with_the_summary(tmp_path, scenario):
    folders = {}
    for name, runners in (("one", None), ("many", 3)):
        record = Recording(links=True, rrd=False)
        run_spread(scenario, runners, overrides=["duration_s=2"], out=tmp_path / name, record=record)
        folders[name] = RunFolder(tmp_path / name)
        assert all(finding.good for finding in verify(tmp_path / name))
    for table in TABLES:
        one, many = (getattr(folder, table)() for folder in folders.values())
        assert len(one) > 0
        assert_frame_equal(one, many)


def test_what_a_jammer_drowned_is_counted_for_sender_receiver_and_link(tmp_path):
    record = Recording(links=True, rrd=False)
    summary = run(
        JAMMED, overrides=["duration_s=2", "events.0.at_s=0.5"], out=tmp_path / "run", record=record
    ).summary()
    folder, jammed = RunFolder(tmp_path / "run"), summary["radio"]["fates"]["jammed"]
    robots, links = folder.radio_robots(), folder.radio_links()
    assert jammed > 0
    assert robots["as_sender_jammed"].sum() == robots["as_receiver_jammed"].sum() == jammed
    assert links.filter(links["fate"] == "jammed")["packets"].sum() == jammed


def called(*arguments):
    return CliRunner().invoke(app, list(map(str, arguments)))


def test_the_commands_record_links_and_draw_the_ratio_over_distance(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    folder = tmp_path / "run"
    ended = called("run", LOSSY, "--set", "duration_s=2", "--links", "--out", folder)
    assert ended.exit_code == 0
    for name in ("age_of_information", "throughput", "airtime"):
        assert name in ended.output
    assert len(RunFolder(folder).radio_links()) > 0
    ended = called("export", folder, "--to", folder / "pdr.png", "--kind", "delivery", "--size", "300")
    assert (ended.exit_code, ended.output.startswith(f"written: {folder}/pdr.png (")) == (0, True)
    assert (folder / "pdr.png").stat().st_size > 1000


def test_links_without_a_place_for_them_are_refused():
    with pytest.raises(BadInput, match="^--links: "):
        Recording(links=True, tables=False)
    refusal = called("repeat", "nowhere", "--links").exception
    assert isinstance(refusal, BadInput)
    assert "--links: expected --out" in str(refusal)


SCENARIO = ROOT / "scenarios" / "flocking-802154.toml"


@pytest.mark.parametrize("preset", PRESETS)
def test_a_flock_runs_over_every_preset(preset: str):
    radio = f'radio={{preset="{preset}",measures={{range={{}},bearing={{}}}},max_payload_bytes=6}}'
    result = run(SCENARIO, overrides=["duration_s=1", "robots.flock.count=5", radio])
    assert result.radio is not None
    assert result.radio.sent > 40
    assert sum(result.radio.fates.values()) == result.radio.intended == 4 * result.radio.sent
