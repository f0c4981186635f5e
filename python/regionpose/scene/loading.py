"""From a scene file to its checked model, with errors that name the line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from regionpose.scene.document import Document, Place, SceneError, described, read_document
from regionpose.scene.models import EXPOSURE_KEYS, CloudFile, FrameItem, ImageMask, ImageSide, SceneModel, WorldSide
from regionpose.segment.segmenters import Segmenter


@dataclass(frozen=True)
class Scene:
    """A checked scene file."""

    document: Document
    model: SceneModel
    name: str = ""
    """Of the frame that it is; none for a whole file."""
    place: Place = ()
    """Of the frame in the file."""
    segmenter: Segmenter | None = None
    """What seeds in photos without a tolerance ask for their masks; they are grown by color where it is None."""

    @property
    def path(self) -> Path:
        """The scene file."""
        return self.document.path

    def file(self, name: str) -> Path:
        """The path of a file that the scene names, relative to the scene file."""
        return self.path.parent / name

    @property
    def image(self) -> str:
        """The photo's name; of a scene without frames."""
        return self.model.image or ""

    @property
    def cloud(self) -> CloudFile | None:
        """The cloud's file as the scene names it, columns None where it names none; None without a cloud."""
        named = self.model.cloud
        return CloudFile(file=named, columns=None) if isinstance(named, str) else named

    @property
    def frames(self) -> tuple[Scene, ...]:
        """The scene of each of its frames: a photo, a cloud, and their regions; itself alone where it has none."""
        if not self.model.frames:
            return (self,)
        return tuple(self._frame(index, frame) for index, frame in enumerate(self.model.frames))

    def _frame(self, index: int, frame: FrameItem) -> Scene:
        given = {key: getattr(frame, key) for key in EXPOSURE_KEYS & frame.model_fields_set}
        shared = {key: getattr(self.model, key) for key in self.model.model_fields_set - {"frames"}}
        model = SceneModel.model_construct(**shared, **given)
        return Scene(self.document, model, frame.name, ("frames", index), self.segmenter)

    def error(self, place: Place, message: str) -> SceneError:
        """The error about the value at `place`, of a frame within it."""
        own = bool(place) and place[0] in EXPOSURE_KEYS
        return self.document.error((*self.place, *place) if own or not place else place, message)


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
    return scene_of(read_document(path))


def scene_of(document: Document) -> Scene:
    """The checked scene of a document; SceneError for the first thing wrong."""
    if not isinstance(document.value, dict):
        raise document.error((), f"found {described(document.value)}; needed a mapping with camera, image and regions")
    scene = Scene(document, model_of(document))
    _check_references(scene)
    return scene


def model_of(document: Document) -> SceneModel:
    """The model of a document, whose references are not checked; SceneError for the first thing wrong."""
    try:
        return SceneModel.model_validate(document.value)
    except ValidationError as error:
        raise _first_error(document, error) from error


def scene_schema() -> dict[str, Any]:
    """The JSON schema of scene files."""
    schema = SceneModel.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


DEVIATIONS_OF = {"initial_rotation_sigma_deg": "initial", "initial_center_sigma_m": "initial", "up_sigma_deg": "up"}
"""Keys of the prior that mean nothing without another."""


def _check_references(scene: Scene) -> None:
    _check_frames(scene)
    for frame in scene.frames:
        _check_exposure(frame)
    with_pairs = [has_pairs(frame) for frame in scene.frames]
    if any(with_pairs) and not all(with_pairs):
        place = () if not scene.model.frames else ("frames", with_pairs.index(False))
        raise scene.document.error(place, "found no region, but some in other frames; needed some in all, or in none")
    prior = scene.model.prior
    for key, of in DEVIATIONS_OF.items():
        if getattr(prior, key) is not None and getattr(prior, of) is None:
            raise scene.error(("prior", key), f"found a deviation of nothing; needed the key {of}")


def _check_frames(scene: Scene) -> None:
    """Check that there is one photo, or frames with distinct names; SceneError otherwise."""
    frames = scene.model.frames
    if not frames and scene.model.image is None:
        raise scene.error(("image",), "found nothing; needed this key, or frames with a photo each")
    both = next((key for key in scene.model.model_fields_set if frames and key in EXPOSURE_KEYS), None)
    if both is not None:
        raise scene.error((both,), "found it beside frames; needed it in each frame")
    names = [frame.name for frame in frames]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise scene.error(("frames", index, "name"), f"found {name!r} twice; needed names that differ")


def _check_exposure(scene: Scene) -> None:
    """Check the regions of a photo and a cloud; SceneError for an invalid one."""
    names: set[str] = set()
    for region in named_regions(scene):
        if region.name in names:
            raise scene.error((*region.place, "name"), f"found {region.name!r} twice; needed names that differ")
        names.add(region.name)
        if isinstance(region.image, ImageMask):
            _check_mask(scene, (*region.place, "image"), region.image)
        if scene.model.cloud is None and needs_cloud(region.world):
            found = "found no cloud to look in; needed the key cloud in the scene"
            raise scene.error((*region.place, "world"), found)
    model = scene.model
    if scene.model.cloud is None and model.world_regions == "planes":
        raise scene.error(("world_regions",), "found planes without a cloud; needed the key cloud in the scene")
    if has_pairs(scene):
        return
    if model.regions or model.image_regions or model.world_regions:
        found = "found regions of one side; needed some with both sides, or image_regions and world_regions"
        raise scene.error(("regions",), found)
    if model.cloud is None or not model.solver.edges:
        found = "found no region; needed one with both sides, image_regions and world_regions, or a cloud whose edges"
        raise scene.error(("regions",), f"{found} are compared with the photo's (solver.edges)")


def has_pairs(scene: Scene) -> bool:
    """Whether a scene of one photo has regions with both sides, or some on either side to be matched."""
    model = scene.model
    return bool(model.regions or (model.image_regions and model.world_regions))


def _check_mask(scene: Scene, place: Place, image: ImageMask) -> None:
    if image.unknown_label is not None and image.unknown is None:
        raise scene.error((*place, "unknown_label"), "found a label without its file; needed the key unknown")
    if image.coverage and (image.label, image.image, image.unknown) != (None,) * 3:
        found = "found it beside label, image or unknown; needed a file of one region, and it alone"
        raise scene.error((*place, "coverage"), found)


class NamedRegion(NamedTuple):
    """A region of a scene: its location in the file, and its sides as written; None for a missing one."""

    place: Place
    name: str
    image: ImageSide | None
    world: WorldSide | None


def named_regions(scene: Scene) -> list[NamedRegion]:
    """All regions that a scene of one photo writes out, those with both sides first."""
    model = scene.model
    found = [NamedRegion(("regions", k), one.name, one.image, one.world) for k, one in enumerate(model.regions)]
    found += [NamedRegion(("image_regions", k), a.name, a.image, None) for k, a in enumerate(model.image_regions)]
    alone = model.world_regions if isinstance(model.world_regions, list) else []
    return found + [NamedRegion(("world_regions", k), b.name, None, b.world) for k, b in enumerate(alone)]


def needs_cloud(side: object) -> bool:
    """Whether a world side needs the cloud: a seed, or indices written out."""
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
    kind, found = details["type"], described(details["input"])
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
    return described(value)


def _plain(message: str) -> str:
    return message.removeprefix("Input should be ").removeprefix("a valid ").rstrip(".")


def _place(location: tuple[int | str, ...]) -> Place:
    """The place in the file of a location in the models, whose tags of choices (`<seed>`) the file doesn't hold."""
    return tuple(part for part in location if not (isinstance(part, str) and part.startswith("<")))
