#!/bin/sh
# Runs the example campaigns and writes their reports under docs/reports/, with a picture of a section.
# The picture is taken by chromium; without it only the pages are written.
set -eu
cd "$(dirname "$0")/../.."
for name in flocking-loss pso-loss; do
    rm -rf "campaigns/$name"
    .ci/uv run --no-sync swarmwire sweep "scenarios/campaigns/$name.toml" --out "campaigns/$name"
    .ci/uv run --no-sync swarmwire report "campaigns/$name" --to "docs/reports/$name.html"
done
if command -v chromium >/dev/null; then
    .ci/uv run --no-sync python -m docs.pictures.page "docs/reports/flocking-loss.html#part-2" docs/reports/flocking-loss.png 1200 560
fi
