"""The programs that a host runs to serve us: `host_side`, as a text that its Python can execute."""

import json
import shlex
from functools import cache
from pathlib import Path

PACKAGE = "swarmwire.deploy.fleet.host_side"
MODULES = ("refusal", "folders", "unpacking", "units", "facts", "releasing", "serving")  # each after those it imports
OLDEST = (3, 11)
START = f"""import sys, json
if sys.version_info < {OLDEST}:
    print(json.dumps({{"refused": "python", "text": "%d.%d.%d" % sys.version_info[:3]}}))
    sys.exit()
sys.path[:] = [path for path in sys.path if path]
exec(sys.stdin.buffer.read(int(sys.stdin.buffer.readline())))"""
LOADER = """import sys, types
package = sys.modules[{package!r}] = types.ModuleType({package!r})
package.__path__ = []
for name, text in {sources}:
    whole = {package!r} + "." + name
    module = sys.modules[whole] = types.ModuleType(whole)
    exec(compile(text, whole, "exec"), module.__dict__)
    setattr(package, name, module)
package.serving.main()"""


def start_command(python: str) -> str:
    """The command for the host's shell; its Python, however old, tells its version, and reads on if it will do."""
    return f"exec {shlex.quote(python)} -c {shlex.quote(START)}"


@cache
def program() -> bytes:
    """What the started Python reads first: a length, and so many bytes of a program."""
    folder = Path(__file__).parent / "host_side"
    sources = [(name, (folder / f"{name}.py").read_text(encoding="utf-8")) for name in MODULES]
    text = LOADER.format(package=PACKAGE, sources=json.dumps(sources)).encode()
    return b"%d\n" % len(text) + text
