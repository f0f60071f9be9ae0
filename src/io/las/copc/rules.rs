//! The rules that COPC files are held to besides those of LAS, each with its clause in COPC 1.0
//! (copc.io).

use crate::stage::Rule;

/// All of them.
pub static RULES: [&Rule; 16] = [
    &INFO,
    &INFO_RESERVED,
    &POINT_FORMAT,
    &VERSION,
    &VARYING,
    &CUBE,
    &CUBE_HOLDS,
    &SPACING,
    &TIMES,
    &HIERARCHY,
    &PAGES,
    &KEY,
    &NODE,
    &NODE_COUNT,
    &NODE_BOX,
    &SORTED,
];

pub static INFO: Rule = Rule::fault(
    "copc-info",
    "COPC 1.0, info VLR",
    "a record `copc` 1 of 160 bytes, the only one and the first, at byte 375",
);
pub static INFO_RESERVED: Rule =
    Rule::warning("copc-info-reserved", "COPC 1.0, info VLR, reserved", "0 in the last 88 bytes");
pub static POINT_FORMAT: Rule =
    Rule::fault("copc-point-format", "COPC 1.0, Implementation", "6, 7 or 8");
pub static VERSION: Rule = Rule::fault(
    "copc-version",
    "COPC 1.0, Implementation",
    "LAS 1.4 with a header of 375 bytes, compressed",
);
pub static VARYING: Rule = Rule::fault(
    "copc-chunks",
    "COPC 1.0, LAZ chunk table",
    "chunks of as many points as the chunk table says of each",
);
pub static CUBE: Rule = Rule::fault(
    "copc-cube",
    "COPC 1.0, info VLR, center and halfsize",
    "finite numbers, the half size above 0",
);
pub static CUBE_HOLDS: Rule = Rule::fault(
    "copc-cube-holds",
    "COPC 1.0, info VLR, center and halfsize",
    "a cube that holds the box of the header",
);
pub static SPACING: Rule =
    Rule::fault("copc-spacing", "COPC 1.0, info VLR, spacing", "a finite number above 0");
pub static TIMES: Rule = Rule::fault(
    "copc-gps-times",
    "COPC 1.0, info VLR, gpstime_minimum and gpstime_maximum",
    "the smallest and the largest GPS time of the points",
);
pub static HIERARCHY: Rule = Rule::fault(
    "copc-hierarchy",
    "COPC 1.0, hierarchy VLR",
    "one extended record `copc` 1000 that holds the pages, and a root page in it",
);
pub static PAGES: Rule = Rule::fault(
    "copc-pages",
    "COPC 1.0, hierarchy VLR, pages",
    "pages of whole entries of 32 bytes within the record, each referred to once",
);
pub static KEY: Rule = Rule::fault(
    "copc-key",
    "COPC 1.0, hierarchy VLR, VoxelKey",
    "a level from 0 on and a place within it, each node once and below one that is there",
);
pub static NODE: Rule = Rule::fault(
    "copc-node",
    "COPC 1.0, hierarchy VLR, Entry",
    "a chunk of its own that the chunk table has, with as many bytes and points",
);
pub static NODE_COUNT: Rule = Rule::fault(
    "copc-node-count",
    "COPC 1.0, hierarchy VLR, pointCount",
    "nodes that have all points together",
);
pub static NODE_BOX: Rule = Rule::fault(
    "copc-node-box",
    "COPC 1.0, hierarchy VLR, VoxelKey",
    "points inside of the cube of their node",
);
pub static SORTED: Rule = Rule::note(
    "copc-time-order",
    "COPC 1.0, Implementation",
    "points of a node in the order of their GPS times, which compress best",
);
