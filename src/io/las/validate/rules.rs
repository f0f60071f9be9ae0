//! The rules that LAS and LAZ files are held to, each with its clause in LAS 1.4 R15, which repeats
//! what versions before it had.

use crate::stage::Rule;

/// All of them.
pub static RULES: [&Rule; 64] = [
    &READABLE,
    &UNREAD,
    &VERSION,
    &RESERVED,
    &SOURCE_ID,
    &ENCODING,
    &WKT_BIT,
    &TIME_BIT,
    &WAVEFORM_BITS,
    &NO_WAVEFORMS,
    &IDENTIFIER,
    &PADDING,
    &DATE,
    &NO_DATE,
    &HEADER_SIZE,
    &HEADER_BYTES,
    &POINTS_START,
    &FORMAT,
    &COMPRESSED,
    &RECORD_LENGTH,
    &NO_POINTS,
    &COUNT,
    &LEGACY_COUNT,
    &RETURNS,
    &LEGACY_RETURNS,
    &SCALE,
    &ODD_SCALE,
    &OFFSET,
    &BOX,
    &BOX_ORDER,
    &LOOSE_BOX,
    &WAVEFORM_START,
    &WAVEFORM_FILE,
    &VLRS,
    &VLR_RESERVED,
    &VLR_USER,
    &VLR_TWICE,
    &GAP,
    &BEHIND,
    &EVLRS,
    &EVLR_START,
    &WKT_TEXT,
    &WKT_END,
    &WKT_SECOND,
    &GEO_KEYS,
    &SYSTEM_KIND,
    &NO_SYSTEM,
    &EXTRA_TYPE,
    &EXTRA_DEPRECATED,
    &EXTRA_LENGTH,
    &EXTRA_NAME,
    &EXTRA_OPTIONS,
    &EXTRA_RECORDS,
    &EXTRA_RANGE,
    &UNDESCRIBED,
    &CHUNK_TABLE,
    &POINTS,
    &RETURN_ZERO,
    &RETURN_BEYOND,
    &CLASS,
    &ANGLE,
    &TIME,
    &WEEK_TIME,
    &COLORS,
];

pub static READABLE: Rule =
    Rule::fault("las-readable", "LAS 1.4 R15", "a file whose records and points can be read");
pub static UNREAD: Rule = Rule::note(
    "las-unread",
    "LAS 1.4 R15",
    "a file that is right so far: the points of this one were not looked at",
);
pub static VERSION: Rule =
    Rule::fault("version", "LAS 1.4 R15, 2.4 Version Major and Version Minor", "1.0 to 1.5");
pub static RESERVED: Rule = Rule::warning(
    "reserved",
    "LAS 1.1, Public Header Block, Reserved",
    "0 in the reserved bytes of LAS 1.0 and 1.1",
);
pub static SOURCE_ID: Rule = Rule::note(
    "file-source-id",
    "LAS 1.4 R15, 2.4 File Source ID",
    "the number of the flight line or survey; 0 says that there is none",
);
pub static ENCODING: Rule = Rule::fault(
    "global-encoding",
    "LAS 1.4 R15, 2.4 Global Encoding, Table 4",
    "0 in all bits that the version does not define",
);
pub static WKT_BIT: Rule = Rule::fault(
    "wkt-bit",
    "LAS 1.4 R15, 2.4 Global Encoding, Bit 4 WKT",
    "set in point formats 6 to 10 and where the reference system is WKT, not set where it is \
     GeoTIFF keys",
);
pub static TIME_BIT: Rule = Rule::fault(
    "gps-time-bit",
    "LAS 1.4 R15, 2.4 Global Encoding, Bit 0 GPS Time Type",
    "set where GPS times are no seconds of a week, which are 0 to 604,800",
);
pub static WAVEFORM_BITS: Rule = Rule::fault(
    "waveform-bits",
    "LAS 1.4 R15, 2.4 Global Encoding, Bits 1 and 2",
    "one of the two at most in point formats 4, 5, 9 and 10, none in others",
);
pub static NO_WAVEFORMS: Rule = Rule::warning(
    "no-waveforms",
    "LAS 1.4 R15, 2.4 Global Encoding, Bits 1 and 2",
    "one of the two bits in point formats 4, 5, 9 and 10, whose points refer to waveforms",
);
pub static IDENTIFIER: Rule = Rule::warning(
    "identifier",
    "LAS 1.4 R15, 2.4 System Identifier and Generating Software",
    "what made the points, and the program that wrote the file",
);
pub static PADDING: Rule = Rule::fault(
    "identifier-padding",
    "LAS 1.4 R15, 2.4 System Identifier and Generating Software",
    "zeros behind the text",
);
pub static DATE: Rule = Rule::fault(
    "creation-date",
    "LAS 1.4 R15, 2.4 File Creation Day of Year and Year",
    "a day from 1 to 365, or 366 in leap years, and a year from 1990 on",
);
pub static NO_DATE: Rule = Rule::warning(
    "no-creation-date",
    "LAS 1.4 R15, 2.4 File Creation Day of Year and Year",
    "the day on which the file was made",
);
pub static HEADER_SIZE: Rule = Rule::fault(
    "header-size",
    "LAS 1.4 R15, 2.4 Header Size",
    "227 bytes, 235 in LAS 1.3 and 375 in LAS 1.4, or more where a writer has bytes of its own",
);
pub static HEADER_BYTES: Rule = Rule::note(
    "header-bytes",
    "LAS 1.4 R15, 2.4 Header Size",
    "a header without bytes behind the fields of its version",
);
pub static POINTS_START: Rule = Rule::fault(
    "points-start",
    "LAS 1.4 R15, 2.4 Offset to Point Data",
    "a byte of the file behind the header and the variable length records",
);
pub static FORMAT: Rule = Rule::fault(
    "point-format",
    "LAS 1.4 R15, 2.4 Point Data Record Format",
    "0 or 1; from LAS 1.2 on also 2 and 3, from 1.3 on 4 and 5, from 1.4 on 6 to 10",
);
pub static COMPRESSED: Rule = Rule::fault(
    "compressed",
    "LAZ 1.4 R1, the point type and the LASzip VLR",
    "128 added to the point format, and a record `laszip encoded`; or neither",
);
pub static RECORD_LENGTH: Rule = Rule::fault(
    "record-length",
    "LAS 1.4 R15, 2.4 Point Data Record Length",
    "the bytes of the point format, or more where there are extra bytes",
);
pub static NO_POINTS: Rule =
    Rule::warning("no-points", "LAS 1.4 R15, 2.4 Number of Point Records", "one point or more");
pub static COUNT: Rule = Rule::fault(
    "point-count",
    "LAS 1.4 R15, 2.4 Number of Point Records",
    "as many points as the file has",
);
pub static LEGACY_COUNT: Rule = Rule::fault(
    "legacy-count",
    "LAS 1.4 R15, 2.4 Legacy Number of Point Records",
    "0 in point formats 6 to 10; in others the number of points, or 0 if that exceeds 32 bits",
);
pub static RETURNS: Rule = Rule::fault(
    "returns",
    "LAS 1.4 R15, 2.4 Number of Points by Return",
    "as many points of each return as the file has",
);
pub static LEGACY_RETURNS: Rule = Rule::fault(
    "legacy-returns",
    "LAS 1.4 R15, 2.4 Legacy Number of Point by Return",
    "0 in point formats 6 to 10; in others the counts by return, or 0",
);
pub static SCALE: Rule =
    Rule::fault("scale", "LAS 1.4 R15, 2.4 X, Y, and Z Scale Factors", "a finite number above 0");
pub static ODD_SCALE: Rule = Rule::warning(
    "odd-scale",
    "LAS 1.4 R15, 2.4 X, Y, and Z Scale Factors",
    "1, 0.5, 0.25 or one of these divided by ten any number of times",
);
pub static OFFSET: Rule =
    Rule::fault("offset", "LAS 1.4 R15, 2.4 X, Y, and Z Offset", "a finite number");
pub static BOX: Rule = Rule::fault(
    "box",
    "LAS 1.4 R15, 2.4 Max and Min X, Y, Z",
    "the largest and the smallest coordinates of the points, to half a step of the scale",
);
pub static BOX_ORDER: Rule = Rule::fault(
    "box-order",
    "LAS 1.4 R15, 2.4 Max and Min X, Y, Z",
    "finite numbers, none of the smallest above the largest",
);
pub static LOOSE_BOX: Rule = Rule::note(
    "loose-box",
    "LAS 1.4 R15, 2.4 Max and Min X, Y, Z",
    "a box that is no larger than that of the points",
);
pub static WAVEFORM_START: Rule = Rule::fault(
    "waveform-start",
    "LAS 1.4 R15, 2.4 Start of Waveform Data Packet Record",
    "the byte of the packets where they are in the file, else 0",
);
pub static WAVEFORM_FILE: Rule = Rule::warning(
    "waveform-file",
    "LAS 1.4 R15, 2.4 Global Encoding, Bit 2",
    "a file of the same name that ends in .wdp, which has the packets",
);
pub static VLRS: Rule = Rule::fault(
    "vlrs",
    "LAS 1.4 R15, 2.5 Variable Length Records",
    "as many records as the header counts, between it and the points",
);
pub static VLR_RESERVED: Rule =
    Rule::warning("vlr-reserved", "LAS 1.4 R15, 2.5 Reserved", "0, and 0xAABB in LAS 1.0");
pub static VLR_USER: Rule = Rule::warning(
    "vlr-user",
    "LAS 1.4 R15, 2.5 User ID",
    "the name of whoever defined the record, zeros behind it",
);
pub static VLR_TWICE: Rule =
    Rule::warning("vlr-twice", "LAS 1.4 R15, 2.5 Record ID and 3", "one record of each kind");
pub static GAP: Rule = Rule::note(
    "gap",
    "LAS 1.4 R15, 2.4 Offset to Point Data",
    "points right behind the variable length records",
);
pub static BEHIND: Rule = Rule::warning(
    "behind",
    "LAS 1.4 R15, 2.4 Number of Point Records",
    "nothing behind the points but extended records",
);
pub static EVLRS: Rule = Rule::fault(
    "evlrs",
    "LAS 1.4 R15, 2.7 Extended Variable Length Records",
    "as many records as the header counts, within the file and behind the points",
);
pub static EVLR_START: Rule = Rule::warning(
    "evlr-start",
    "LAS 1.4 R15, 2.4 Start of First Extended Variable Length Record",
    "0 where the header counts none",
);
pub static WKT_TEXT: Rule = Rule::fault(
    "wkt-text",
    "LAS 1.4 R15, 3 OGC Coordinate System WKT Record",
    "well-known text of a coordinate reference system, its brackets closed",
);
pub static WKT_END: Rule = Rule::warning(
    "wkt-end",
    "LAS 1.4 R15, 3 OGC Coordinate System WKT Record",
    "a zero behind the text, and nothing else behind that",
);
pub static WKT_SECOND: Rule = Rule::warning(
    "wkt-version",
    "LAS 1.4 R15, 3 OGC Coordinate System WKT Record",
    "well-known text of version 1 (OGC 01-009)",
);
pub static GEO_KEYS: Rule = Rule::fault(
    "geotiff-keys",
    "LAS 1.4 R15, 3 GeoKeyDirectoryTag Record; GeoTIFF 1.1, 7.1",
    "keys in rising order whose values are in the directory or in the records of numbers and texts",
);
pub static SYSTEM_KIND: Rule = Rule::fault(
    "crs-kind",
    "LAS 1.4 R15, 2.2 Coordinate Reference System (CRS) Representation",
    "well-known text in point formats 6 to 10",
);
pub static NO_SYSTEM: Rule = Rule::note(
    "no-crs",
    "LAS 1.4 R15, 2.2 Coordinate Reference System (CRS) Representation",
    "a record that says in which coordinate reference system the points are",
);
pub static EXTRA_TYPE: Rule = Rule::fault(
    "extra-bytes-type",
    "LAS 1.4 R15, 4.3 Extra Bytes, data_type",
    "0 to 10, or 11 to 30 of older files",
);
pub static EXTRA_DEPRECATED: Rule = Rule::warning(
    "extra-bytes-deprecated",
    "LAS 1.4 R15, 4.3 Extra Bytes, data_type",
    "0 to 10: pairs and triples, 11 to 30, are deprecated",
);
pub static EXTRA_LENGTH: Rule = Rule::fault(
    "extra-bytes-length",
    "LAS 1.4 R15, 4.3 Extra Bytes",
    "descriptors of 192 bytes each that describe no more bytes than the points have",
);
pub static EXTRA_NAME: Rule = Rule::warning(
    "extra-bytes-name",
    "LAS 1.4 R15, 4.3 Extra Bytes, name",
    "a name of its own for each descriptor",
);
pub static EXTRA_OPTIONS: Rule = Rule::warning(
    "extra-bytes-options",
    "LAS 1.4 R15, 4.3 Extra Bytes, options",
    "bits 0 to 4 alone, and a scale that is finite and not 0 where bit 3 says that there is one",
);
pub static EXTRA_RECORDS: Rule =
    Rule::warning("extra-bytes-records", "LAS 1.4 R15, 4.3 Extra Bytes", "one record");
pub static EXTRA_RANGE: Rule = Rule::warning(
    "extra-bytes-range",
    "LAS 1.4 R15, 4.3 Extra Bytes, min and max",
    "values from min to max, where options say that there are these",
);
pub static UNDESCRIBED: Rule = Rule::note(
    "extra-bytes-undescribed",
    "LAS 1.4 R15, 4.3 Extra Bytes",
    "a descriptor for all bytes behind the fields of the point format",
);
pub static CHUNK_TABLE: Rule = Rule::warning(
    "chunk-table",
    "LAZ 1.4 R1, Chunk Table",
    "a table that says how many bytes each chunk of points has",
);
pub static POINTS: Rule = Rule::fault(
    "points",
    "LAS 1.4 R15, 2.6 Point Data Records",
    "points that can be read, and decoded where they are compressed",
);
pub static RETURN_ZERO: Rule = Rule::warning(
    "return-zero",
    "LAS 1.4 R15, 2.6 Return Number and Number of Returns",
    "numbers from 1 on",
);
pub static RETURN_BEYOND: Rule = Rule::fault(
    "return-beyond",
    "LAS 1.4 R15, 2.6 Return Number",
    "a return number that is not above the number of returns",
);
pub static CLASS: Rule = Rule::warning(
    "class",
    "LAS 1.4 R15, 2.6 Classification, Tables 9 and 17",
    "a class that the specification does not reserve",
);
pub static ANGLE: Rule = Rule::fault(
    "scan-angle",
    "LAS 1.4 R15, 2.6 Scan Angle Rank and Scan Angle",
    "-90 to 90 degrees in point formats 0 to 5, -180 to 180 in others",
);
pub static TIME: Rule =
    Rule::fault("gps-time", "LAS 1.4 R15, 2.6 GPS Time", "a finite number of seconds");
pub static WEEK_TIME: Rule = Rule::warning(
    "gps-time-week",
    "LAS 1.4 R15, 2.4 Global Encoding, Bit 0 GPS Time Type",
    "not set where GPS times are seconds of a week",
);
pub static COLORS: Rule = Rule::warning(
    "colors",
    "LAS 1.4 R15, 2.6 Red, Green, Blue",
    "colours of 16 bits: those of 8 bits are multiplied by 256 or 257",
);
