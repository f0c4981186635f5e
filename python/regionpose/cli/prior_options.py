"""The options `--near`, `--up` and `--mount`, and the priors that they give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, cast

import typer

from regionpose.cli.options import numbers_of

if TYPE_CHECKING:
    from regionpose.solve.prior import Mount

MOUNTS = ("front", "left", "rear", "right")

Near = Annotated[
    str | None,
    typer.Option(
        "--near",
        help="How near the scanner the camera stands, 1 sigma along each axis, meters; or x,y,z,sigma.  [default:"
        " 0.5, without regions]",
        show_default=False,
    ),
]
Up = Annotated[
    str | None,
    typer.Option(
        "--up",
        help="Which way is up in the clouds, of a camera that is upright to some 5 degrees: x, y, z, -x, ... or"
        " x,y,z.  [default: none]",
        show_default=False,
    ),
]
Mounts = Annotated[
    list[str] | None,
    typer.Option(
        "--mount",
        metavar="[CAMERA=]front|left|rear|right",
        help="Where the camera looks, to some 20 degrees, in clouds with x forward, y left and z up. Of several"
        " cameras once for each, as left=front.",
        show_default=False,
    ),
]


class PriorOptions(NamedTuple):
    """The options, read: a place and how near the camera is to it, a direction, mounts by camera, and the scanner's
    place.

    `mounts` has the key None for a mount of all cameras.
    """

    place: list[float] | None
    near_m: float | None
    up: tuple[float, ...] | None
    mounts: dict[str | None, Mount]
    origin: list[float] | None

    @classmethod
    def of(cls, near: str | None, up: str | None, mounts: Sequence[str], origin: str | None) -> PriorOptions:
        """The parsed options; ValueError that names a bad one."""
        from regionpose.solve.prior import AXES

        place, sigma = None, None
        if near is not None:
            *place, sigma = numbers_of("--near", near, 4 if "," in near else 1, "meters, or x,y,z,sigma")
        axis = None if up is None else AXES.get(up) or numbers_of("--up", up, 3, "x, y, z, -x, -y, -z or x,y,z")
        scanner = None if origin is None else list(numbers_of("--sensor-origin", origin, 3, "x,y,z"))
        return cls(place or None, sigma, axis, _mounts(mounts), scanner)

    def check(self, cameras: Sequence[str]) -> None:
        """Check that mounts name given cameras, or none for a single camera; ValueError otherwise."""
        for name in self.mounts:
            if name is not None and name not in cameras:
                needed = f"a mount of {', '.join(cameras)}" if cameras else "front, left, rear or right alone"
                raise ValueError(f"--mount: found one of {name}; needed {needed}")

    def prior(self, camera: str | None = None) -> dict[str, Any]:
        """The prior of a camera's pose as the scene's key; ValueError that names the options."""
        from regionpose.scene.solver_config import prior_values
        from regionpose.solve.prior import Prior

        mount = self.mounts.get(camera, self.mounts.get(None))
        try:
            prior = Prior.mounted(mount, up=self.up, near_m=self.near_m, place=self.place or self.origin)
        except ValueError as error:
            raise ValueError(f"--near, --up or --mount: {error}") from error
        values = prior_values(prior)
        # The scanner's place is that of each cloud's file, where that has one.
        if self.place is None and mount is None:
            values.pop("camera_near", None)
        return values


def _mounts(words: Sequence[str]) -> dict[str | None, Mount]:
    """Mounts by camera; ValueError for other words, and for two mounts of a camera."""
    found: dict[str | None, Mount] = {}
    for word in words:
        name, mark, direction = word.rpartition("=")
        camera = name if mark else None
        if direction not in MOUNTS or (mark and not name):
            raise ValueError(f"--mount: found {word!r}; needed {', '.join(MOUNTS)}, or CAMERA=front")
        if camera in found:
            raise ValueError(f"--mount: found {word!r} beside another one; needed one for each camera")
        found[camera] = cast("Mount", direction)
    return found
