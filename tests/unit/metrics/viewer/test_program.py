"""Rerun's program as a child: what it may reach, and where it listens."""

import json
import sys
from ipaddress import ip_address, ip_network
from pathlib import Path

from swarmwire.metrics.pictures.viewer import program
from swarmwire.metrics.pictures.viewer.program import CLOSED_PROXY, closed_environment, hidden_loopback, is_open


def test_rerun_reports_no_usage_by_its_settings():
    folder = Path(closed_environment()["XDG_CONFIG_HOME"])
    assert json.loads((folder / "rerun" / "analytics.json").read_text("utf-8"))["analytics_enabled"] is False


def test_rerun_reaches_nothing_also_where_the_user_has_a_proxy(monkeypatch):
    for name in ("https_proxy", "HTTPS_PROXY", "no_proxy", "NO_PROXY", "all_proxy"):
        monkeypatch.setenv(name, "swarm.example")
    proxies = {name: value for name, value in closed_environment().items() if name.upper().endswith("_PROXY")}
    assert proxies == dict.fromkeys(("ALL_PROXY", "HTTPS_PROXY", "HTTP_PROXY"), CLOSED_PROXY)
    assert not is_open(int(CLOSED_PROXY.rsplit(":", 1)[1]))


def test_loopback_addresses_are_random_where_there_are_many(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    hosts = {hidden_loopback() for _ in range(20)}
    assert len(hosts) == 20
    assert all(ip_address(host) in ip_network("127.0.0.0/8") for host in hosts)
    monkeypatch.setattr(sys, "platform", "darwin")
    assert hidden_loopback() == program.LOOPBACK == "127.0.0.1"
