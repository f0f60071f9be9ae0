//! Exit codes: what they say, and which error leads to which.

use crate::{Error, ErrorKind};

/// What help says of them.
pub(super) const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    the run failed: I/O, bad data, over budget
  2    the command or the pipeline is wrong
  3    the run is done, and the result is not accepted by its rules
  130  interrupted

Results go to stdout, progress and messages to stderr.";

/// The exit code that an error leads to.
pub(super) fn exit_number(error: &Error) -> u8 {
    match error.kind() {
        ErrorKind::Io | ErrorKind::Data | ErrorKind::Memory | ErrorKind::Internal => 1,
        ErrorKind::Pipeline => 2,
        ErrorKind::NotAccepted => 3,
        ErrorKind::Interrupted => 130,
    }
}
