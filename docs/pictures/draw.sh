#!/usr/bin/env bash
# Draws the pictures of README and docs: from runs that it makes,
# and the figures of the radio from its own functions. Needs a Vulkan driver for those of rerun's viewer.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
swarmwire() { .ci/uv run --no-sync swarmwire "$@"; }
runs="$(mktemp -d)"
trap 'rm -rf "$runs"' EXIT
swarmwire run scenarios/flocking-disrupted.toml --quiet --out "$runs/flocking-disrupted"
swarmwire run scenarios/split.toml --quiet --no-rrd --packets all --out "$runs/split"
swarmwire run scenarios/pso.toml --quiet --out "$runs/pso"
swarmwire export "$runs/flocking-disrupted" --kind viewer --at 35 --to docs/rerun.png
swarmwire export "$runs/split" --at 35 --to docs/split.png
swarmwire export "$runs/pso" --at 55 --to docs/pso.png
swarmwire run scenarios/drones.toml --quiet --no-rrd --out "$runs/drones"
swarmwire export "$runs/drones" --at 50 --to docs/drones.png
swarmwire new "$runs/my_swarm" # as in docs/getting-started.md
swarmwire run "$runs/my_swarm" --quiet --no-rrd --packets all --out "$runs/first"
swarmwire export "$runs/first" --at 4 --to docs/first.png
swarmwire sweep "$runs/my_swarm" --vary radio.loss=0,0.9,0.95,0.98 --seeds 5 --set duration_s=10 --out "$runs/loss"
swarmwire report "$runs/loss"
cp "$runs/loss/figures/response-order.final-radio.loss.svg" docs/first-report.svg
for body in crazyflie epuck epuck2 flockbot footbot kilobot point turtlebot3-burger turtlebot4; do
  swarmwire draw "$body" --to "docs/bodies/$body.png"
done
swarmwire radio probe scenarios/warehouse-wifi.toml --at=-6,-3.5 --bytes 64 --to docs/coverage.png
swarmwire run scenarios/warehouse-wifi.toml --quiet --no-rrd --out "$runs/warehouse"
swarmwire export "$runs/warehouse" --kind delivery --to docs/delivery.png
.ci/uv run --no-sync python examples/motion/simulator.py 127.0.0.1:9870 100 &
swarmwire run examples/motion/udp.toml --realtime 1 --quiet --no-rrd --out "$runs/udp"
kill $!
swarmwire export "$runs/udp" --kind delivery --to docs/motion-delivery.png
.ci/uv run --no-sync python -m docs.pictures.hero
.ci/uv run --no-sync python -m docs.pictures.tutorial
.ci/uv run --no-sync python docs/pictures/panel.py
.ci/uv run --no-sync python -m docs.pictures.radio
.ci/uv run --no-sync python -m docs.pictures.stages
.ci/uv run --no-sync python -m docs.pictures.trace
.ci/uv run --no-sync python -m docs.pictures.runner_states
.ci/uv run --no-sync python -m docs.pictures.agent_processes
.ci/uv run --no-sync python -m docs.pictures.parts
.ci/uv run --no-sync python -m docs.pictures.robots
.ci/uv run --no-sync python -m docs.pictures.epuck2_camera
.ci/uv run --no-sync python -m docs.pictures.tick_figure
.ci/uv run --no-sync python -m docs.pictures.performance
.ci/uv run --no-sync python -m docs.pictures.radio_chain
if command -v babeld >/dev/null; then
  .ci/uv run --no-sync python -m docs.pictures.routing
fi
if command -v chromium >/dev/null; then
  .ci/uv run --no-sync python -m docs.pictures.live_page
fi
