"""A folder of photos and clouds of one rig, read as the scene of all of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from regionpose.io.clouds.kinds import ENDINGS
from regionpose.io.masks.mask_files import file_items
from regionpose.io.masks.mask_items import MaskItem
from regionpose.io.reading import IMAGE_SUFFIXES
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.document import Document, Place, SceneError, described, document_of, read_document
from regionpose.scene.loading import Scene, scene_of
from regionpose.scene.models import PLANES
from regionpose.scene.paths import rebased, relative

Values = dict[str, Any]

HEADING = "# Written by `regionpose calibrate`; `regionpose estimate` on it gives the same pose.\n"

SHARED = ("camera", "prior", "solver")
"""Keys of a pair's scene file that are the rig's, and the same in all pairs that have them."""

CLOUDS = "clouds"
"""The folder with the clouds that several cameras share, unless these are beside the cameras' folders."""

CALIBRATION = "calib"
"""The name, without its ending, of the calibration in a folder of photos."""

SEGMENTED = "{}-regions/scene.yaml"
"""What `regionpose segment` writes of a pair's scene file."""


class Source(NamedTuple):
    """Where a value of the folder's scene comes from: a pair's scene file and the place there, or another file."""

    file: Document | Path
    place: Place = ()


Sources = dict[Place, Source]


@dataclass(frozen=True)
class FolderDocument(Document):
    """The scene file of a folder, whose errors name the file of the pair that each value comes from."""

    sources: Mapping[Place, Source] = field(default_factory=dict)

    def error(self, place: Place, message: str) -> SceneError:
        """The error about the value at `place`."""
        for length in range(len(place), 0, -1):
            source = self.sources.get(place[:length])
            if source is None:
                continue
            if isinstance(source.file, Document):
                return source.file.error((*source.place, *place[length:]), message)
            return SceneError(f"{source.file}: {_without_path(message, source.file)}")
        return super().error(place, message)


def _without_path(message: str, file: Path) -> str:
    """The message without the path of a file, as the written scene would name it, at its beginning."""
    path, _, rest = message.partition(": ")
    return rest if rest and Path(path).resolve() == file.resolve() else message


@dataclass(frozen=True)
class FolderOptions:
    """What holds for all pairs of a folder.

    `camera`: the scene's key, its file relative to the working folder. `sensor_origin` (3,): where the scanner stood,
    of pairs without their own. `coco`: a file with the regions of all photos. `columns`: names of the columns of
    clouds whose files have none. `prior`: the scene's key, of pairs without their own.
    """

    camera: str | dict[str, Any] | None = None
    sensor_origin: list[float] | None = None
    coco: Path | None = None
    columns: Sequence[str] | None = None
    prior: dict[str, Any] | None = None


@dataclass(frozen=True)
class Pair:
    """A photo and a cloud of one name, the scene file beside them, and the pictures that are its masks."""

    name: str
    photo: Path
    cloud: Path | None
    document: Document | None
    masks: tuple[Path, ...]

    @property
    def document_values(self) -> Values:
        """What the scene file holds, nothing where there is none."""
        return {} if self.document is None or not isinstance(self.document.value, dict) else self.document.value


def folder_scene(
    folder: Path, path: Path, options: FolderOptions | None = None, shared: Sequence[Path] = ()
) -> tuple[Scene, list[Path]]:
    """The scene of all pairs of a folder, to be written to `path`, and the photos left out for want of a cloud.

    Its document holds the text to be written. `shared`: further folders with clouds. SceneError that names a pair's
    file for what cannot be used.
    """
    pairs, alone = folder_pairs(folder, shared)
    return scene_of_pairs(folder, pairs, path, options or FolderOptions()), alone


def pair_scene(photo: Path, cloud: Path, path: Path, options: FolderOptions) -> Scene:
    """The scene of one photo and one cloud, to be written to `path`, and of the scene file beside the photo."""
    document = _document(photo.parent, photo.stem)
    return scene_of_pairs(photo, [Pair(photo.stem, photo, cloud, document, ())], path, options)


def scene_of_pairs(
    folder: Path, pairs: Sequence[Pair], path: Path, chosen: FolderOptions, remarks: Sequence[str] = ()
) -> Scene:
    """The scene of pairs, to be written to `path`, with remarks as comments; `folder`: named where a camera is missing.

    SceneError that names a pair's file for what cannot be used.
    """
    values, sources = _shared(folder, pairs, path.parent, chosen)
    by_edges = not any(_has_regions(pair, chosen, path.parent) for pair in pairs)
    frames = [_frame(pair, path.parent, chosen, by_edges=by_edges) for pair in pairs]
    values["frames"] = [frame for frame, _ in frames]
    for index, (_, own) in enumerate(frames):
        sources |= {("frames", index, *place): source for place, source in own.items()}
    heading = HEADING + "".join(f"# {remark}\n" for remark in remarks)
    written = document_of(path, (heading + to_yaml(values)).encode())
    return scene_of(FolderDocument(path, written.value, written.lines, written.content, sources))


def camera_folders(folder: Path) -> list[Path]:
    """Folders with photos in a folder that has none itself, one for each camera; none of another folder."""
    if not folder.is_dir() or _by_name(_files(folder), IMAGE_SUFFIXES):
        return []
    inner = sorted(each for each in folder.iterdir() if each.is_dir() and not each.name.startswith("."))
    return [each for each in inner if each.name != CLOUDS and _by_name(_files(each), IMAGE_SUFFIXES)]


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.is_file()) if folder.is_dir() else []


def folder_pairs(folder: Path, shared: Sequence[Path] = ()) -> tuple[list[Pair], list[Path]]:
    """The pairs of a folder by name, and the photos without a cloud, which may also be in one of the `shared` folders.

    A picture without a cloud whose name begins with a pair's and a hyphen is a mask of the pair. SceneError where
    there is no pair, or a name has several photos or clouds.
    """
    if not folder.is_dir():
        raise SceneError(f"{folder}: found {'a file' if folder.exists() else 'nothing'}; needed a folder")
    photos, clouds = _by_name(_files(folder), IMAGE_SUFFIXES), _by_name(_files(folder), ENDINGS)
    for place in shared:
        clouds = _by_name(_files(place), ENDINGS) | clouds
    documents = {name: _document(folder, name) for name in photos}
    paired = [name for name in photos if name in clouds or _names_cloud(documents[name])]
    if not paired:
        places = " or ".join(str(place) for place in shared)
        needed = "needed such as 0001.png and 0001.pcd" + f" beside it, or in {places}" * bool(places)
        raise SceneError(f"{folder}: found no photo with a cloud of its name; {needed}")
    masks: dict[str, list[Path]] = {name: [] for name in paired}
    alone: list[Path] = []
    for name in photos.keys() - masks.keys():
        owner = max((pair for pair in paired if name.startswith(f"{pair}-")), key=len, default=None)
        (alone if owner is None else masks[owner]).extend(photos[name])
    pairs = [_pair(name, photos[name], clouds.get(name, []), documents[name], masks[name]) for name in paired]
    return pairs, sorted(alone)


def _by_name(files: Sequence[Path], endings: Iterable[str]) -> dict[str, list[Path]]:
    """The files of these endings by their names without them."""
    by_stem: dict[str, list[Path]] = {}
    for file in files:
        if file.suffix.lower() in endings:
            by_stem.setdefault(file.stem, []).append(file)
    return by_stem


def _document(folder: Path, name: str) -> Document | None:
    """The scene file beside a photo: what `regionpose segment` made of it, if that is there."""
    places = (folder / SEGMENTED.format(name), folder / f"{name}.yaml", folder / f"{name}.yml")
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        return None
    document = read_document(found)
    if not isinstance(document.value, dict):
        raise document.error((), f"found {described(document.value)}; needed a mapping with the pair's regions")
    return document


def _names_cloud(document: Document | None) -> bool:
    value = document.value if document is not None else None
    return isinstance(value, dict) and isinstance(value.get("cloud"), str | dict)


def _pair(name: str, photos: list[Path], clouds: list[Path], document: Document | None, masks: list[Path]) -> Pair:
    """The pair of a name; SceneError where it isn't clear which photo or which cloud is meant."""
    if len(photos) > 1:
        raise SceneError(f"{photos[0]}: found {photos[1].name}, too; needed one photo of the name")
    cloud = next(iter(clouds), None)
    if document is not None and _names_cloud(document):
        cloud = None
    elif len(clouds) > 1:
        found = f"found {clouds[1].name}, too; needed one cloud of the name, or the key cloud in {name}.yaml"
        raise SceneError(f"{clouds[0]}: {found}")
    return Pair(name, photos[0], cloud, document, tuple(sorted(masks)))


def _shared(folder: Path, pairs: Sequence[Pair], out: Path, options: FolderOptions) -> tuple[Values, Sources]:
    """What is the same for all pairs; SceneError where two pairs differ in it, and where there is no camera."""
    values: Values = {}
    sources: Sources = {}
    if options.camera is not None:
        values["camera"] = rebased({"camera": options.camera}, Path(), out)["camera"]
        named = options.camera if isinstance(options.camera, str) else options.camera["file"]
        sources["camera",] = Source(Path(named))
    if options.prior:
        values["prior"], sources["prior",] = options.prior, Source(Path("prior of the options"))
    given = set(values)
    for document in (pair.document for pair in pairs if pair.document is not None):
        _share(document, values, sources, out, given)
    if "camera" not in values:
        calibration = _calibration(folder)
        values["camera"], sources["camera",] = relative(calibration, out), Source(calibration)
    return {key: values[key] for key in SHARED if key in values}, sources


def _calibration(folder: Path) -> Path:
    """The calibration in a folder; SceneError where there is none, or several."""
    found = [file for file in _files(folder) if file.stem == CALIBRATION]
    if len(found) > 1:
        raise SceneError(f"{found[0]}: found {found[1].name}, too; needed one calibration, or camera")
    if not found:
        beside = f", or {CALIBRATION}.yaml in the folder" * folder.is_dir()
        raise SceneError(f"{folder}: found no camera; needed camera, the key camera in a pair's scene file{beside}")
    return found[0]


def _share(document: Document, values: Values, sources: Sources, out: Path, given: set[str]) -> None:
    """Add the values that a pair's scene file gives for all pairs; SceneError where two files differ."""
    given_values: Values = rebased(document.value, document.path.parent, out)
    for key in (key for key in SHARED if key in given_values and key not in given):
        if key in values and values[key] != given_values[key]:
            other = sources[key,].file
            path = other.path if isinstance(other, Document) else other
            raise document.error((key,), f"found another than that of {path}; needed one {key} for all pairs")
        values.setdefault(key, given_values[key])
        sources.setdefault((key,), Source(document, (key,)))


def _has_regions(pair: Pair, options: FolderOptions, out: Path) -> bool:
    """Whether any file holds regions of a pair."""
    keys = ("regions", "image_regions", "world_regions")
    return any(pair.document_values.get(key) for key in keys) or bool(_drawn(pair, options.coco, out))


def _frame(pair: Pair, out: Path, options: FolderOptions, *, by_edges: bool) -> tuple[Values, Sources]:
    """The frame of a pair, and where each of its values comes from; `by_edges`: no pair has regions."""
    values: Values = {"name": pair.name, "image": relative(pair.photo, out)}
    sources: Sources = {(): Source(pair.photo), ("image",): Source(pair.photo)}
    if pair.cloud is not None:
        file = relative(pair.cloud, out)
        values["cloud"] = file if options.columns is None else {"file": file, "columns": list(options.columns)}
        sources["cloud",] = Source(pair.cloud)
    if options.sensor_origin is not None:
        values["sensor_origin"] = list(options.sensor_origin)
    if pair.document is not None:
        _check_photo(pair, pair.document)
        _check_cloud(pair, pair.document)
        own: Values = rebased(pair.document_values, pair.document.path.parent, out)
        for key in own.keys() - {*SHARED, "image", "name"}:
            values[key], sources[key,] = own[key], Source(pair.document, (key,))
    if not by_edges and not pair.document_values.get("regions") and not pair.document_values.get("image_regions"):
        _add_drawn(pair, values, sources, _drawn(pair, options.coco, out))
    if values.get("image_regions") and "world_regions" not in pair.document_values:
        values["world_regions"] = PLANES
        sources["world_regions",] = sources["cloud",]
    return values, sources


def _check_photo(pair: Pair, document: Document) -> None:
    """Check that a pair's scene file names the pair's photo, or none; SceneError otherwise."""
    named = pair.document_values.get("image")
    if named is not None and (document.path.parent / str(named)).resolve() != pair.photo.resolve():
        raise document.error(("image",), f"found {described(named)}; needed {pair.photo.name}, or no such key")


def _check_cloud(pair: Pair, document: Document) -> None:
    """Check that a pair's scene file names the cloud that was given with the photo, or one of them names none;
    SceneError otherwise.
    """
    named = pair.document_values.get("cloud")
    file = named.get("file") if isinstance(named, dict) else named
    if pair.cloud is None or not isinstance(file, str):
        return
    if (document.path.parent / file).resolve() != pair.cloud.resolve():
        raise document.error(("cloud",), f"found {described(file)}; needed {pair.cloud.name}, or no such key")


class Drawn(NamedTuple):
    """A region of the photo that a file beside it holds: its name, its values in the scene, and the file."""

    name: str
    image: Values
    file: Path


def _drawn(pair: Pair, coco: Path | None, out: Path) -> list[Drawn]:
    """The regions of a pair's photo by the files beside it: labelme or COCO, and masks."""
    found: list[Drawn] = []
    beside = pair.photo.with_suffix(".json")
    if beside.is_file():
        found += [Drawn(item.name, {"label": item.name}, beside) for item in _items(beside)]
    if coco is not None:
        labels = [(item.name, {"label": item.name, "image": pair.photo.name}) for item in _items(coco, pair.photo.name)]
        found += [Drawn(name, values, coco) for name, values in labels]
    for mask in pair.masks:
        items, name = _items(mask), mask.stem.removeprefix(f"{pair.name}-") or "region"
        if len(items) == 1:
            found.append(Drawn(name, {}, mask))
        else:
            found += [Drawn(f"{name} {item.name}", {"label": item.number}, mask) for item in items]
    return [one._replace(image={"mask": relative(one.file, out), **one.image}) for one in found]


def _items(path: Path, image: str | None = None) -> list[MaskItem]:
    try:
        return file_items(path, image)
    except (ValueError, OSError) as error:
        raise SceneError(str(error)) from error


def _add_drawn(pair: Pair, values: Values, sources: Sources, drawn: Sequence[Drawn]) -> None:
    """Add regions of files beside a photo: pairs of those whose name is also a world region's, the others unpaired."""
    if not drawn:
        needed = f"needed {pair.name}.yaml, {pair.name}.json or masks {pair.name}-*.png beside it"
        raise SceneError(f"{pair.photo}: found no region of the photo; {needed}")
    listed = values.get("world_regions")
    worlds = dict(enumerate(listed)) if isinstance(listed, list) else {}
    named = {str(one["name"]): k for k, one in worlds.items() if isinstance(one, dict) and "name" in one}
    regions: list[Values] = []
    alone: list[Values] = []
    for one in drawn:
        index = named.pop(one.name, None)
        if index is None:
            sources["image_regions", len(alone)] = Source(one.file)
            alone.append({"name": one.name, "image": one.image})
        else:
            _pair_up(pair, sources, len(regions), index, one)
            regions.append({**worlds.pop(index), "image": one.image})
    values |= {key: kept for key, kept in (("regions", regions), ("image_regions", alone)) if kept}
    if regions:
        _keep_worlds(pair, values, sources, worlds)


def _pair_up(pair: Pair, sources: Sources, index: int, world: int, drawn: Drawn) -> None:
    """Record the source of each side of a pair of regions."""
    assert pair.document is not None
    sources["regions", index] = Source(pair.document, ("world_regions", world))
    sources["regions", index, "image"] = Source(drawn.file)


def _keep_worlds(pair: Pair, values: Values, sources: Sources, left: Mapping[int, Any]) -> None:
    """Keep the world regions that no region of a file beside the photo is named after."""
    assert pair.document is not None
    del values["world_regions"]
    if left:
        values["world_regions"] = list(left.values())
        sources |= {("world_regions", k): Source(pair.document, ("world_regions", j)) for k, j in enumerate(left)}
