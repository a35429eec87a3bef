"""The page of calls in the docstring of `swarmwire.comms.radio` names functions and files that exist."""

import re
from pathlib import Path

from swarmwire.comms import radio

ROW = re.compile(r"^ {4}[|+ -]*(?P<names>\w[\w., ]*?)  +(?P<files>[\w/]+\.py(?:, [\w/]+\.py)*)", re.MULTILINE)


def test_call_page_names_functions_in_their_files():
    rows = list(ROW.finditer(radio.__doc__ or ""))
    assert len(rows) > 25
    for row in rows:
        for file in row["files"].split(", "):
            text = (Path(radio.__file__).parent / file).read_text()
            for name in row["names"].split(", "):
                *classes, last = name.split(".")
                for part in classes or ([last] if last[0].isupper() else []):
                    assert f"class {part}(" in text or f"class {part}:" in text, name
                assert classes == [] or f"def {last}(" in text, name
                assert classes or last[0].isupper() or f"def {last}(" in text, name
