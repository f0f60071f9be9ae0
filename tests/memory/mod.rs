//! Memory that files may cost, whatever they claim.

mod las_damage;
mod las_records;
mod scans;
