#!/bin/sh
# Runs the example campaigns and writes their reports under docs/reports/, with a picture of a section.
# The picture is taken by chromium; without it only the pages are written.
set -eu
cd "$(dirname "$0")/../.."
write_report() { # NAME RESPONSE...: few responses keep the committed page small
    name=$1
    shift
    rm -rf "campaigns/$name"
    .ci/uv run --no-sync swarmwire sweep "scenarios/campaigns/$name.toml" --out "campaigns/$name"
    .ci/uv run --no-sync swarmwire report "campaigns/$name" --to "docs/reports/$name.html" "$@"
}
write_report flocking-loss --response stop_time_s --response order --response radio.link_pdr
write_report pso-loss --response find_time_s --response target_mean --response radio.link_pdr
if command -v chromium >/dev/null; then
    .ci/uv run --no-sync python -m docs.pictures.page "docs/reports/flocking-loss.html#part-2" docs/reports/flocking-loss.png 1200 560
fi
