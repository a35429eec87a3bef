"""What polars raises of a file that is damaged."""


def damage() -> tuple[type[BaseException], ...]:
    """Its errors, and its panics: a damaged Parquet file may break what its own code takes for granted.

    A panic is no Exception. polars tells of it on stderr, and goes on.
    """
    import polars as pl

    return (pl.exceptions.PolarsError, pl.exceptions.PanicException)
