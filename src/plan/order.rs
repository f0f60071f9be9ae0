//! In which order outputs get their records, and whether that takes a sort.

use super::sorted::Sorted;
use crate::engine::by_rank;
use crate::stage::{CreateSink, Order, Source};
use crate::{Error, Result};

/// In which order records are written.
pub(super) struct WriteOrder {
    /// True if the run needs tiles: for its stages, or because an output is to be in canonical
    /// order.
    pub(super) mills: bool,
    /// For each sink, whether it gets the order of the inputs.
    pub(super) in_input_order: Vec<bool>,
}

impl WriteOrder {
    pub(super) fn new(sorted: &Sorted, source: &dyn Source) -> Result<WriteOrder> {
        let sinks = &sorted.sinks;
        // Branches of stages that stream go by tiles, and keep the order that a stream has.
        let (ops, streams) = (!sorted.ops.is_empty(), !sorted.filters.is_empty());
        let each = || sinks.iter().map(|sink| &**sink);
        let sorts = |sink: &dyn CreateSink| sink.is_folder() || sink.order() == Order::Canonical;
        let mills = ops || streams || each().any(sorts);
        let keeps = |sink: &dyn CreateSink| match sink.order() {
            Order::Input => true,
            Order::Auto => streams && !ops && !sink.is_folder(),
            Order::Canonical => false,
        };
        let in_input_order: Vec<bool> = each().map(keeps).collect();
        if mills && in_input_order.contains(&true) && source.parts() > by_rank::MOST_PARTS {
            let told = "the inputs have too many parts for an output in their order";
            return Err(Error::pipeline(told).help("leave `write.order` out"));
        }
        Ok(WriteOrder { mills, in_input_order })
    }
}
