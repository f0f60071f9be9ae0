#!/usr/bin/env python3
"""Writes the table of coordinate reference systems that is src/io/epsg/systems.txt.

usage: epsg_table.py > src/io/epsg/systems.txt

Needs pyproj, whose database of PROJ has the EPSG Dataset. Every text that the table was made of is put
together again from its lines and compared; exits with 1 at the first that differs.
"""

import re
import sqlite3
import sys
from pathlib import Path

import pyproj
from pyproj import CRS
from pyproj.database import query_crs_info
from pyproj.enums import PJType

KINDS = ["GEOGRAPHIC_2D_CRS", "GEOCENTRIC_CRS", "PROJECTED_CRS", "VERTICAL_CRS", "COMPOUND_CRS"]
HEAD = """\
# Coordinate reference systems of the EPSG Dataset {version} (IOGP; epsg.org), from the tables of PROJ
# {proj}, as tests/interop/epsg_table.py writes them. A line is a kind, a code, and fields behind "|":
# unit: name, size in metres or radians. meridian: name, longitude. ellipsoid: name, half axis, inverse
# flattening. datum, height: name, ellipsoid (none for heights), other names. method: name, parameters.
# geographic: name, datum, meridian, unit. geocentric: name, datum. projected: name, geographic system,
# method, unit, values of its parameters. vertical: name, datum, unit, what its axis is.
# compound: name, system of x and y, of z."""


def parse(text: str):
    """A text as nested lists: word, then values."""
    at = 0

    def node():
        nonlocal at
        word = re.compile(r"\w+").match(text, at)
        at = word.end()
        if text[at : at + 1] != "[":
            return word.group()
        items = [word.group()]
        while text[at] != "]":
            at += 1
            if text[at] == '"':
                quoted = re.compile(r'"((?:[^"]|"")*)"').match(text, at)
                at = quoted.end()
                items.append(quoted.group(1))
            elif number := re.compile(r"-?[\d.][\d.eE+-]*").match(text, at):
                at = number.end()
                items.append(number.group())
            else:
                items.append(node())
        at += 1
        return items

    return node()


def all_of(node, word):
    return [inner for inner in node if isinstance(inner, list) and inner[0] == word]


def one(node, word):
    return all_of(node, word)[0]


def code(node) -> int:
    return int(one(node, "AUTHORITY")[2])


lines: dict[tuple[str, int], list] = {}
methods: dict[tuple, int] = {}


def enter(kind: str, number: int, *fields: object) -> int:
    fields = [str(field) for field in fields]
    if any("|" in field or "\n" in field for field in fields):
        sys.exit(f"{kind} {number}: a field with a bar: {fields}")
    if lines.setdefault((kind, number), fields) != fields:
        raise ValueError(f"{kind} {number}: {fields}, not {lines[kind, number]}")
    return number


def unit(node) -> int:
    return enter("unit", code(node), node[1], node[2])


def datum(node) -> int:
    ball = one(node, "SPHEROID")
    enter("ellipsoid", code(ball), ball[1], ball[2], ball[3])
    return enter("datum", code(node), node[1], code(ball))


def geographic(node) -> int:
    meridian = one(node, "PRIMEM")
    enter("meridian", code(meridian), meridian[1], meridian[2])
    fields = [datum(one(node, "DATUM")), code(meridian), unit(one(node, "UNIT"))]
    return enter("geographic", code(node), node[1], *fields)


def projected(node) -> int:
    method, parameters = one(node, "PROJECTION")[1], all_of(node, "PARAMETER")
    shape = (method, *(name for _, name, _ in parameters))
    # What its extension says is said by a name of its own, which it is written back from.
    if all_of(node, "EXTENSION"):
        shape = (method + "*", *shape[1:])
    number = methods.setdefault(shape, len(methods) + 1)
    enter("method", number, *shape)
    values = [value for *_, value in parameters]
    axes = "" if all_of(node, "AXIS") else "-"
    base = geographic(one(node, "GEOGCS"))
    return enter("projected", code(node), node[1], base, f"{number}{axes}", unit(one(node, "UNIT")), *values)


def vertical(node) -> int:
    height = one(node, "VERT_DATUM")
    enter("height", code(height), height[1], "")
    axis = one(node, "AXIS")
    return enter("vertical", code(node), node[1], code(height), unit(one(node, "UNIT")), axis[1])


def system(node) -> int:
    match node[0]:
        case "GEOGCS":
            return geographic(node)
        case "GEOCCS":
            return enter("geocentric", code(node), node[1], datum(one(node, "DATUM")))
        case "PROJCS":
            return projected(node)
        case "VERT_CS":
            return vertical(node)
        case "COMPD_CS":
            return enter("compound", code(node), node[1], system(node[2]), system(node[3]))


def aliases() -> None:
    """Other names of datums, those of WKT of ESRI above all."""
    path = Path(pyproj.datadir.get_data_dir()) / "proj.db"
    db = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    plain = lambda name: re.sub(r"[^a-z0-9]", "", name.lower().removeprefix("d_"))
    for table, kind in (("geodetic_datum", "datum"), ("vertical_datum", "height")):
        rows = db.execute(
            "SELECT code, alt_name FROM alias_name WHERE auth_name = 'EPSG' AND table_name = ?"
            " UNION SELECT code, name FROM " + table + " WHERE auth_name = 'EPSG' ORDER BY 1, 2",
            [table],
        )
        for number, name in rows:
            fields = lines.get((kind, int(number)))
            if not fields or "|" in name:
                continue
            if plain(name) not in {plain(known) for known in fields}:
                fields.append(name)
    global version
    version = db.execute("SELECT value FROM metadata WHERE key = 'EPSG.VERSION'").fetchone()[0]


skipped = 0
for kind in KINDS:
    for info in query_crs_info("EPSG", PJType[kind], allow_deprecated=True):
        try:
            text = CRS.from_epsg(int(info.code)).to_wkt("WKT1_GDAL")
        except pyproj.exceptions.CRSError:
            continue
        if not text:
            continue
        before = {key: list(value) for key, value in lines.items()}
        try:
            system(parse(text))
        except (ValueError, IndexError) as error:
            lines.clear(), lines.update(before)
            skipped += 1
            print(info.code, info.name, error, file=sys.stderr)
aliases()
order = ["unit", "meridian", "ellipsoid", "datum", "height", "method", "geographic", "geocentric",
         "projected", "vertical", "compound"]
print(HEAD.format(version=version, proj=pyproj.proj_version_str))
for (kind, number), fields in sorted(lines.items(), key=lambda e: (order.index(e[0][0]), e[0][1])):
    print(kind, "|".join([str(number), *fields]))
print(len(lines), "lines,", skipped, "systems left out", file=sys.stderr)
