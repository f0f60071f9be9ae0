//! Which flags of a command stand together in its help.

/// How inputs are read: the fields of `ReadArguments`.
const READ: &[&str] =
    &["from", "columns", "scans", "crs", "reproject", "assume", "on_error", "bounds", "resolution"];

/// How outputs are written: the fields of `WrittenArguments`.
const WRITTEN: &[&str] = &[
    "scale",
    "offset",
    "point_format",
    "drop",
    "map",
    "types",
    "intensity",
    "encoding",
    "colors",
    "separator",
    "decimals",
    "header",
];

/// Groups of flags: the command, the heading, and the fields of its arguments.
pub(super) const GROUPS: &[(&str, &str, &[&str])] = &[
    (
        "reduce",
        "How much to keep",
        &[
            "preset",
            "keep",
            "tolerance",
            "size",
            "max_spacing",
            "weight",
            "borders",
            "effort",
            "ranks",
            "preview",
            "max_angle",
            "max_side",
            "min_spacing",
            "side",
            "min_points",
            "split",
            "measure",
            "reference",
            "passes",
        ],
    ),
    ("reduce", "How the surface is measured", &["neighbors", "method", "z_scale", "lattice"]),
    ("reduce", "Which points", READ),
    (
        "reduce",
        "Which points",
        &[
            "outliers",
            "classes",
            "keep_classes",
            "drop_classes",
            "noise",
            "withheld",
            "nonfinite",
            "headers",
        ],
    ),
    ("reduce", "Output", WRITTEN),
    ("reduce", "Output", &["output", "outdir", "to", "mark", "order"]),
    ("convert", "Which points", READ),
    ("convert", "Which points", &["keep_classes", "drop_classes", "nonfinite", "headers"]),
    ("convert", "Many files", &["jobs", "resume", "summary"]),
    ("convert", "Output", WRITTEN),
    ("convert", "Output", &["output", "to"]),
];
