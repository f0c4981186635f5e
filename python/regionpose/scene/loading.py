"""From a scene file to its checked model, with errors that name the line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from regionpose.scene.document import Document, Place, SceneError, brief, read_document
from regionpose.scene.models import ImageMask, SceneModel


@dataclass(frozen=True)
class Scene:
    """A checked scene file."""

    document: Document
    model: SceneModel

    @property
    def path(self) -> Path:
        """The scene file."""
        return self.document.path

    def file(self, name: str) -> Path:
        """The path of a file that the scene names, relative to the scene file."""
        return self.path.parent / name

    def error(self, place: Place, message: str) -> SceneError:
        """The error about the value at `place`."""
        return self.document.error(place, message)


def load_scene(path: str | Path) -> Scene:
    """The checked scene of a YAML or JSON file; no other file is opened.

    Parameters
    ----------
    path : str or Path
        Of the scene file.

    Raises
    ------
    FileNotFoundError
        Where it is missing.
    SceneError
        A ValueError, as `scene.yaml:14: regions[1].image.seed: found 3 numbers; needed [x, y]` for the first thing
        wrong.
    """
    document = read_document(path)
    if not isinstance(document.value, dict):
        raise document.error((), f"found {brief(document.value)}; needed a mapping with camera, image and regions")
    try:
        model = SceneModel.model_validate(document.value)
    except ValidationError as error:
        raise _first_error(document, error) from error
    scene = Scene(document, model)
    _check_references(scene)
    return scene


def scene_schema() -> dict[str, Any]:
    """The JSON schema of scene files."""
    schema = SceneModel.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


DEVIATIONS_OF = {"initial_rotation_sigma_deg": "initial", "initial_center_sigma_m": "initial", "up_sigma_deg": "up"}
"""Keys of the prior that mean nothing without another."""


def _check_references(scene: Scene) -> None:
    names: set[str] = set()
    for index, region in enumerate(scene.model.regions):
        if region.name in names:
            raise scene.error(("regions", index, "name"), f"found {region.name!r} twice; needed names that differ")
        names.add(region.name)
        image = region.image
        if isinstance(image, ImageMask) and image.unknown_label is not None and image.unknown is None:
            place = ("regions", index, "image", "unknown_label")
            raise scene.error(place, "found a label of nothing; needed the key unknown")
        if isinstance(image, ImageMask) and image.coverage and (image.label, image.image, image.unknown) != (None,) * 3:
            place = ("regions", index, "image", "coverage")
            raise scene.error(
                place, "found it beside label, image or unknown; needed a file of one region, and it alone"
            )
        if scene.model.cloud is None and needs_cloud(region.world):
            raise scene.error(
                ("regions", index, "world"), "found no cloud to look in; needed the key cloud in the scene"
            )
    if scene.model.cloud is None and scene.model.solver.refine == "scene":
        raise scene.error(("solver", "refine"), "found scene, but no cloud; needed the key cloud in the scene")
    prior = scene.model.prior
    for key, of in DEVIATIONS_OF.items():
        if getattr(prior, key) is not None and getattr(prior, of) is None:
            raise scene.error(("prior", key), f"found a deviation of nothing; needed the key {of}")


def needs_cloud(side: object) -> bool:
    """Whether a world side says nothing without the cloud: a seed, or indices written out."""
    return hasattr(side, "seed") or isinstance(getattr(side, "points", None), list)


def _first_error(document: Document, error: ValidationError) -> SceneError:
    """The error that stands first in the file, and how many more there are."""
    found = [_placed(details) for details in error.errors(include_url=False)]
    found.sort(key=lambda entry: document.line(entry[0]))
    more = len(found) - 1
    tail = "" if not more else f" (and {more} more {'problem' if more == 1 else 'problems'})"
    place, message = found[0]
    return document.error(place, message + tail)


def _placed(details: ErrorDetails) -> tuple[Place, str]:
    """The place of an error in the file and its message."""
    place = _place(details["loc"])
    context = details.get("ctx", {})
    if details["type"] == "unknown_key":
        place = (*place, context["key"])
    return place, _message(details, context)


def _message(details: ErrorDetails, context: dict[str, Any]) -> str:
    kind, found = details["type"], brief(details["input"])
    if kind in {"numbers", "unknown_key"}:
        return details["msg"]
    if kind == "missing":
        return "found nothing; needed this key"
    if kind == "choice":
        return f"found {_chosen(details['input'])}; needed {details['msg']}"
    if kind == "too_short":
        return f"found {context['actual_length']} items; needed at least {context['min_length']}"
    if kind == "too_long":
        return f"found {context['actual_length']} items; needed at most {context['max_length']}"
    if kind == "literal_error":
        return f"found {found}; needed {context['expected']}"
    needed = {
        "model_type": "a mapping",
        "list_type": "a list",
        "string_type": "a string",
        "string_too_short": "some text",
        "string_too_long": f"at most {context.get('max_length')} characters",
    }
    return f"found {found}; needed {needed.get(kind, _plain(details['msg']))}"


def _chosen(value: object) -> str:
    """What was found where one of several keys was needed."""
    if isinstance(value, dict) and value:
        return f"model {value['model']!r}" if "model" in value else f"the keys {', '.join(map(str, value))}"
    return brief(value)


def _plain(message: str) -> str:
    return message.removeprefix("Input should be ").removeprefix("a valid ").rstrip(".")


def _place(location: tuple[int | str, ...]) -> Place:
    """The place in the file of a location in the models, whose tags of choices (`<seed>`) the file doesn't hold."""
    return tuple(part for part in location if not (isinstance(part, str) and part.startswith("<")))
