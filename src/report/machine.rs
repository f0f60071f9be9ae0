//! The machine and the process: what the report says of where a run took place.

use std::fs;

use serde::Serialize;

use crate::host::process::{field, processors};

/// Where a run took place.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Machine {
    /// Operating system and processor architecture, as in `linux x86_64`.
    pub system: String,
    /// Model name of the processor; None where the system does not tell.
    pub processor: Option<String>,
    /// Threads that can run at once, by the process's affinity and quota.
    pub cores: usize,
}

impl Machine {
    /// This machine.
    pub(crate) fn this() -> Self {
        let processor = fs::read_to_string("/proc/cpuinfo").ok();
        Machine {
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            processor: processor.and_then(|text| field(&text, "model name").map(str::to_owned)),
            cores: processors(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_a_core() {
        assert!(Machine::this().cores >= 1);
    }
}
