"""LAS files in longitude and latitude are refused; files in meters, whatever they say of themselves, are read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cloud_samples import POINTS
from regionpose.io.clouds import CloudError, read_cloud

LON_LAT = np.column_stack([8.4 + POINTS[:, 0] * 1.4e-5, 49.0 + POINTS[:, 1] * 9e-6, POINTS[:, 2]])
GEOGRAPHIC = 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257]],UNIT["degree",0.0174532925]]'
GEODETIC_3D = 'GEOGCRS["WGS 84",DATUM["x",ELLIPSOID["y",1,2]],CS[ellipsoidal,3],AXIS["lat",north]]'
PROJECTED = f'COMPD_CS["a",PROJCS["UTM 32",{GEOGRAPHIC},UNIT["metre",1]],VERT_CS["h",UNIT["metre",1]]]'
GEOCENTRIC = 'GEODCRS["WGS 84",DATUM["x",ELLIPSOID["y",1,2]],CS[Cartesian,3],UNIT["metre",1]]'


def las_of(path: Path, points: Any, scale: float, wkt: str | None = None, keys: dict[int, int] | None = None) -> Path:
    """A LAS file of points, with what it says of its coordinates."""
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [scale, scale, 1e-3], np.floor(points.min(axis=0))
    if wkt is not None:
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
    if keys is not None:
        record = laspy.vlrs.known.GeoKeyDirectoryVlr()
        rows = [(1, 1, 0, len(keys)), *((key, 0, 1, value) for key, value in keys.items())]
        record.parse_record_data(np.array(rows, dtype="<u2").tobytes())
        header.vlrs.append(record)
    stored = laspy.LasData(header)
    stored.x, stored.y, stored.z = points.T
    stored.write(str(path))
    return path


@pytest.mark.parametrize(
    "said",
    [{"wkt": GEOGRAPHIC}, {"wkt": GEODETIC_3D}, {"keys": {1024: 2, 2048: 4326}}, {"keys": {2048: 4326}}, {}],
)
def test_las_in_degrees_is_refused(tmp_path: Path, said: dict[str, Any]) -> None:
    path = las_of(tmp_path / "a.las", LON_LAT, 1e-9, **said)
    with pytest.raises(
        CloudError, match=r"a\.las: coordinates: found degrees of longitude .* x from 8\.39.*; needed meters"
    ):
        read_cloud(path)


@pytest.mark.parametrize(
    ("points", "scale", "said"),
    [
        (POINTS, 1e-3, {}),
        (POINTS, 1e-6, {}),
        (POINTS * [1e-3, 1e-3, 1.0], 1e-4, {}),
        (POINTS, 1e-3, {"wkt": PROJECTED}),
        (POINTS, 1e-3, {"wkt": GEOCENTRIC}),
        (POINTS, 1e-3, {"keys": {1024: 1, 2048: 4326, 3072: 32632}}),
        (POINTS, 1e-3, {"keys": {1024: 3, 2048: 4326}}),
    ],
)
def test_las_in_meters_is_read(tmp_path: Path, points: Any, scale: float, said: dict[str, Any]) -> None:
    cloud = read_cloud(las_of(tmp_path / "a.las", np.asarray(points), scale, **said))
    np.testing.assert_allclose(cloud.points, points, rtol=0, atol=max(scale, 1e-3))
