"""Files as a power cut, a worn disk or a copy that broke off leave them."""

from hypothesis import strategies as st


def damaged(parquet: bytes) -> st.SearchStrategy[bytes]:
    """A Parquet file that is cut off, or in which a few bits are turned: as often in its footer as anywhere."""
    last = len(parquet) - 1
    footer = len(parquet) - 8 - int.from_bytes(parquet[-8:-4], "little")
    place = st.integers(0, last) | st.integers(footer, last)
    turned = st.lists(st.tuples(place, st.integers(0, 7)), min_size=1, max_size=8).map(lambda at: _turned(parquet, at))
    return turned | turned | st.integers(0, last).map(lambda end: parquet[:end])


def _turned(data: bytes, bits: list[tuple[int, int]]) -> bytes:
    changed = bytearray(data)
    for place, bit in bits:
        changed[place] ^= 1 << bit
    return bytes(changed)
