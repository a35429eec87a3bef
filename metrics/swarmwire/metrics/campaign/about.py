"""What a campaign was asked for: campaign.json, read and checked."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.config import check_format, did_you_mean, from_json
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.formats import CAMPAIGN_FORMAT
from swarmwire.metrics.campaign.response import KINDS, Response

DESIGNS = ("grid", "list", "random", "latin")
Value = bool | int | float | str | list[Any] | None  # of a parameter
Point = Mapping[str, Value]  # path of each parameter that is varied -> its value there
JsonObject = dict[str, Any]


@dataclass(frozen=True)
class About:
    """campaign.json. A run is a point with a seed; its number is point * len(seeds) + the seed's place."""

    name: str
    scenario: str  # its name
    command: str  # that was typed
    began_utc: str  # ISO 8601
    versions: Mapping[str, Any]  # of Python and packages
    cpu: str
    modules: Mapping[str, str]  # sha256 of the installed code, by module
    files: tuple[str, ...]  # that the scenario needs, below scenario/
    design: str  # one of DESIGNS
    seeds: tuple[int, ...]
    vary: Mapping[str, list[Value] | Mapping[str, Value]]  # path -> values, or {"from", "to"}
    points: tuple[Point, ...]
    overrides: tuple[str, ...]  # "path=value", of every run
    duration_s: float  # of a run that nothing stops
    responses: tuple[Response, ...]

    @property
    def runs(self) -> int:
        """How many runs were asked for."""
        return len(self.points) * len(self.seeds)


def read_about(path: Path) -> About:
    """What campaign.json at this path says; BadInput if it is none, is damaged, or is of another format."""
    try:
        found: object = from_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(str(path.parent), path.name, "expected a campaign's folder: the file is missing") from None
    except (OSError, ValueError) as error:
        raise BadInput(str(path), "", f"expected what a campaign was asked for: {error}") from error
    check_format(found, CAMPAIGN_FORMAT, str(path))
    return _about(_Fields(found, str(path)))


class _Fields:
    """Fields of a JSON object, each of the type that is asked for, or BadInput."""

    def __init__(self, found: object, where: str, key: str = "") -> None:
        self.where, self.key = where, key
        if not isinstance(found, dict):
            raise BadInput(where, key.rstrip("."), "expected an object")
        self.found = cast("JsonObject", found)

    def get(self, name: str, kind: type | tuple[type, ...], expected: str) -> Any:
        """The field; BadInput unless it is there and of that type."""
        value = self.found.get(name)
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise BadInput(self.where, f"{self.key}{name}", f"expected {expected}")
        return value

    def text(self, name: str) -> str:
        return self.get(name, str, "a text")

    def objects(self, name: str) -> "list[_Fields]":
        items = self.get(name, list, "a list of objects")
        return [_Fields(item, self.where, f"{self.key}{name}[{place}].") for place, item in enumerate(items)]

    def texts(self, name: str) -> tuple[str, ...]:
        items = self.get(name, list, "a list of texts")
        if not all(isinstance(item, str) for item in items):
            raise BadInput(self.where, f"{self.key}{name}", "expected a list of texts")
        return tuple(items)

    def one_of(self, name: str, known: tuple[str, ...]) -> Any:
        value = self.text(name)
        if value not in known:
            raise BadInput(self.where, f"{self.key}{name}", f"expected {did_you_mean(known, value)}, got {value!r}")
        return value


def _about(fields: _Fields) -> About:
    return About(
        name=fields.text("name"),
        scenario=fields.text("scenario"),
        command=fields.text("command"),
        began_utc=fields.text("began_utc"),
        versions=fields.get("versions", dict, "an object"),
        cpu=fields.text("cpu"),
        modules=fields.get("modules", dict, "an object"),
        files=tuple(of.text("path") for of in fields.objects("files")),
        design=fields.one_of("design", DESIGNS),
        seeds=_seeds(fields),
        vary=fields.get("vary", dict, "an object"),
        points=_points(fields),
        overrides=fields.texts("overrides"),
        duration_s=float(fields.get("duration_s", (int, float), "a number of s")),
        responses=tuple(_response(of) for of in fields.objects("responses")),
    )


def _seeds(fields: _Fields) -> tuple[int, ...]:
    seeds: list[Any] = fields.get("seeds", list, "a list of integers")
    if not seeds or not all(type(seed) is int for seed in seeds) or len(set(seeds)) < len(seeds):
        raise BadInput(fields.where, "seeds", "expected a list of integers, each once")
    return tuple(seeds)


def _points(fields: _Fields) -> tuple[Point, ...]:
    paths: JsonObject = fields.get("vary", dict, "an object")
    points = fields.objects("points")
    if not points:
        raise BadInput(fields.where, "points", "expected at least one point")
    for point in points:
        if set(point.found) != set(paths):
            raise BadInput(
                fields.where, point.key.rstrip("."), "expected a value of each path that is varied, no other"
            )
    return tuple({path: point.found[path] for path in paths} for point in points)


def _response(of: _Fields) -> Response:
    return Response(
        column=of.text("column"),
        unit=of.text("unit"),
        kind=of.one_of("kind", KINDS),
        help=of.text("help"),
        listed=of.get("listed", bool, "true or false"),
        hold_s=float(of.get("hold_s", (int, float), "a number of s")),
    )
