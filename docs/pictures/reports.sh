#!/bin/sh
# Runs the example campaigns and writes their reports under docs/reports/, each with a picture of how it begins.
# The pictures are taken by chromium; without one only the pages are written.
set -eu
cd "$(dirname "$0")/../.."
for name in flocking-loss pso-loss; do
    rm -rf "campaigns/$name"
    .ci/uv run --no-sync swarmwire sweep "scenarios/campaigns/$name.toml" --out "campaigns/$name"
    .ci/uv run --no-sync swarmwire report "campaigns/$name" --to "docs/reports/$name.html"
done
if command -v chromium >/dev/null; then
    .ci/uv run --no-sync python -m docs.pictures.page "docs/reports/flocking-loss.html#part-3" docs/reports/flocking-loss.png 1280 1250
    .ci/uv run --no-sync python -m docs.pictures.page "docs/reports/pso-loss.html#part-3" docs/reports/pso-loss.png 1280 1250
    .ci/uv run --no-sync python -m docs.pictures.page docs/reports/flocking-loss.html docs/reports/flocking-loss-phone.png 390 2400
fi
