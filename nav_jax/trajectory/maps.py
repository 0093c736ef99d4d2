"""Tracks for maps: KML (OGC 07-147r2, with the times of its extension gx) and GPX 1.1."""

import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

_KML, _GX = "http://www.opengis.net/kml/2.2", "http://www.google.com/kml/ext/2.2"
_GPX = "http://www.topografix.com/GPX/1/1"

Stamps = list[str] | None


def kml(name: str, degrees: Float64[np.ndarray, "E 3"], stamps: Stamps) -> bytes:
    """A track of longitude, latitude in degrees and height in m; with times if there are."""
    root = ET.Element("kml", {"xmlns": _KML, "xmlns:gx": _GX})
    mark = ET.SubElement(ET.SubElement(root, "Document"), "Placemark")
    ET.SubElement(mark, "name").text = name
    line = ET.SubElement(mark, "LineString" if stamps is None else "gx:Track")
    ET.SubElement(line, "altitudeMode").text = "absolute"
    points = [f"{lon:.9f},{lat:.9f},{h:.4f}" for lat, lon, h in degrees]
    if stamps is None:
        ET.SubElement(line, "coordinates").text = " ".join(points)
    else:
        for stamp in stamps:
            ET.SubElement(line, "when").text = stamp
        for point in points:
            ET.SubElement(line, "gx:coord").text = point.replace(",", " ")
    return _document(root)


def gpx(name: str, degrees: Float64[np.ndarray, "E 3"], stamps: Stamps) -> bytes:
    """The same in GPX; elevations are heights above the ellipsoid, as everything here."""
    root = ET.Element("gpx", {"xmlns": _GPX, "version": "1.1", "creator": "nav_jax"})
    track = ET.SubElement(root, "trk")
    ET.SubElement(track, "name").text = name
    segment = ET.SubElement(track, "trkseg")
    for i, (lat, lon, h) in enumerate(degrees):
        point = ET.SubElement(segment, "trkpt", {"lat": f"{lat:.9f}", "lon": f"{lon:.9f}"})
        ET.SubElement(point, "ele").text = f"{h:.4f}"
        if stamps is not None:
            ET.SubElement(point, "time").text = stamps[i]
    return _document(root)


def _document(root: ET.Element) -> bytes:
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True)


MAPS: dict[str, Callable[[str, np.ndarray, Stamps], bytes]] = {".kml": kml, ".gpx": gpx}
"""Suffix -> what writes such a file."""
