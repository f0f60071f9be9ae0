use super::*;
use crate::io::synthetic::{Scene, Synthetic};
use crate::stage::OpenSource;

fn settings(by: By, threads: usize) -> Settings {
    Settings { view: View::Above, by, width: 200, threads }
}
