//! The keys of `read` and `write` as formats and stages know them.

use std::path::PathBuf;

use super::kinds::{OutputOrder, PointFormat, Read, Write};
use super::split::SplitBy;
use crate::quantity::Setting;
use crate::stage::{Order, ReadKeys, WriteKeys};

impl Write {
    /// The order as stages know it.
    pub(crate) fn stage_order(&self) -> Order {
        match self.order {
            None => Order::Auto,
            Some(OutputOrder::Canonical) => Order::Canonical,
            Some(OutputOrder::Input) => Order::Input,
        }
    }

    /// What the output is split by, each with the key that says it.
    pub(super) fn splits(&self) -> Vec<(&'static str, SplitBy)> {
        let by = [
            self.side.map(SplitBy::Side),
            self.by.clone().map(SplitBy::Dimension),
            self.points.map(|points| SplitBy::Points(points.get())),
            self.bytes.map(SplitBy::Bytes),
        ];
        by.into_iter().flatten().map(|by| (by.key(), by)).collect()
    }

    /// What formats know of it.
    pub(super) fn keys(&self, path: PathBuf) -> WriteKeys {
        WriteKeys {
            path,
            computed: self.dimensions.clone(),
            drop: self.drop.clone(),
            map: self.map.clone(),
            types: self.types.clone(),
            scale: self.scale,
            offset: self.offset,
            point_format: self.point_format.map(format_number),
            intensity: self.intensity,
            encoding: self.encoding,
            colors: self.colors,
            separator: self.separator,
            decimals: self.decimals.map(|decimals| decimals.get() as u8),
            header: self.header,
        }
    }
}

impl Read {
    /// What formats know of it.
    pub(super) fn keys(&self) -> ReadKeys {
        let mut keys = ReadKeys::default();
        keys.columns.clone_from(&self.columns);
        let scans = self.scans.as_ref();
        keys.scans = scans.map(|scans| scans.iter().map(|number| number.get()).collect());
        keys.crs.clone_from(&self.crs);
        keys.reproject.clone_from(&self.reproject);
        keys.assume.clone_from(&self.assume);
        keys.on_error = self.on_error.unwrap_or_default();
        keys.bounds.clone_from(&self.bounds);
        keys.resolution = self.resolution;
        (keys.scale, keys.offset) = (self.scale, self.offset);
        keys.point_format = self.point_format.map(format_number);
        keys
    }
}

fn format_number(format: Setting<PointFormat>) -> Setting<u8> {
    match format {
        Setting::Auto => Setting::Auto,
        Setting::Given(format) => Setting::Given(format.get() as u8),
    }
}
