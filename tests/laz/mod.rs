//! The decoder of compressed points.

mod damage;
mod oracle;
