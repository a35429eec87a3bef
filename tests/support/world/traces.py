"""Motion traces to try."""

from hypothesis import strategies as st

from swarmwire.world.motion.traces.trace import MotionTrace, trace_from

coordinates = st.integers(-50_000, 50_000).map(lambda hundredths: hundredths / 100.0)


@st.composite
def traces(draw: st.DrawFn, *, max_robots: int = 3, jumps: bool = True) -> MotionTrace:
    """Some robots named by numbers, in space, that also stand and jump."""
    robots = draw(st.integers(1, max_robots))
    samples = [_samples(draw, jumps) for _ in range(robots)]
    return trace_from([str(3 * robot + 1) for robot in range(robots)], samples)


def _samples(draw: st.DrawFn, jumps: bool) -> list[list[float]]:
    ticks = sorted(draw(st.lists(st.integers(0, 300), min_size=1, max_size=6, unique=not jumps)))
    samples = list[list[float]]()
    for tick in ticks:
        stands = samples and draw(st.booleans())
        position = samples[-1][1:] if stands else [draw(coordinates) for _ in range(3)]
        samples.append([tick / 10.0, *position])
    return samples
