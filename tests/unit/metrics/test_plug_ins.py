from swarmwire.metrics.plug_ins import GROUP, PlugIn, plug_ins
from tests.support.metrics.packages import install


def test_what_packages_bring_is_known_by_name_before_anything_is_imported(tmp_path, monkeypatch):
    install(tmp_path, "compass_metrics", {"east": "East"}, code="raise RuntimeError")
    monkeypatch.syspath_prepend(tmp_path)
    assert plug_ins()["east"] == PlugIn("east", "compass_metrics:East", "compass_metrics", twice=False)
    assert f"[{GROUP}]" in (tmp_path / "compass_metrics-1.0.dist-info" / "entry_points.txt").read_text()


def test_a_name_that_two_packages_bring_is_told_twice(tmp_path, monkeypatch):
    install(tmp_path, "one_metrics", {"east": "East"})
    install(tmp_path, "other_metrics", {"east": "East"})
    monkeypatch.syspath_prepend(tmp_path)
    assert plug_ins()["east"].twice
