//! What a stage needs and gives, in the words of a plan.

use crate::point::{Column, ColumnKind, ColumnValue, Mark, SHIFT};

/// Everything a plan can check before a run.
///
/// ```
/// use pointmill::point::{Column, NORMAL};
/// use pointmill::stage::Needs;
///
/// const ROUGHNESS: Column<f32> = Column::new("Roughness", &[]);
/// let needs = Needs::none().reads_of_neighbors(&NORMAL, 8).writes(&ROUGHNESS);
/// assert_eq!((needs.neighbors, needs.removes), (8, false));
/// ```
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Needs {
    /// Dimensions of the records that it looks at. Stages that work on tiles look at `X`, `Y`, `Z`
    /// and `Classification` by this, and at any other as at a [column](Needs::reads).
    pub dimensions: Vec<String>,
    /// Dimensions of the records that it looks at where they have them, and does without else.
    pub if_there: Vec<String>,
    /// Dimensions of the records that it changes.
    pub changes: Vec<String>,
    /// Columns whose values it reads at the positions that it decides about, or computes for.
    pub reads: Vec<ColumnKind>,
    /// Those of [`reads`](Needs::reads) whose values it reads at their neighbours, too.
    pub of_neighbors: Vec<ColumnKind>,
    /// Columns that it computes.
    pub writes: Vec<ColumnKind>,
    /// True if it reads the tile's [partition](crate::tile::Tile::cells), which a stage above made.
    pub takes_cells: bool,
    /// True if it makes the tile's partition.
    pub makes_cells: bool,
    /// Nearest other positions that each position's result is computed from; 0 for none.
    pub neighbors: usize,
    /// True if it may come to take fewer, once the scan is known.
    pub fewer_neighbors: bool,
    /// Side in lattice steps of the cells whose points are decided together; 0 for none (or not
    /// settled yet).
    pub cell_side: i64,
    /// True if it decides about the points of a cell together, also while their side is not
    /// settled.
    pub cells: bool,
    /// True if cells of that side are octree nodes, so that no tile face cuts one.
    pub cell_aligned: bool,
    /// Working memory per position of the tile, rim included.
    pub bytes_per_point: usize,
    /// Bytes that it holds for each position of the scan, from the end of its first phase on.
    pub of_scan: usize,
    /// Bytes that it holds then besides, whatever the scan.
    pub of_any_scan: u64,
    /// True if it reads the [numbers](crate::point::PointBatch::record_numbers) that records have
    /// in the input.
    pub record_numbers: bool,
    /// True if any byte of a record may decide what it does with it, whatever dimension that is of.
    pub whole_records: bool,
    /// True if it removes points.
    pub removes: bool,
    /// True if it says of what it removes how far it is from the surface of what stands for it.
    pub measures: bool,
    /// How it marks records instead of removing any, if it does.
    pub mark: Option<Mark>,
    /// True if it moves points by the column [`SHIFT`], which it computes.
    pub moves: bool,
    /// How often the stages from the last that computed a column to this one are applied, each time
    /// to what the time before left, and which column; none is once.
    pub repeats: Option<(ColumnKind, usize)>,
}

impl Needs {
    /// Nothing: to be told from there.
    pub fn none() -> Self {
        Needs::default()
    }

    /// And it looks at these dimensions of the records.
    #[must_use]
    pub fn looks_at<'a>(mut self, names: impl IntoIterator<Item = &'a str>) -> Self {
        self.dimensions.extend(names.into_iter().map(str::to_owned));
        self
    }

    /// And it looks at these dimensions of the records where they have them.
    #[must_use]
    pub fn looks_at_if_there<'a>(mut self, names: impl IntoIterator<Item = &'a str>) -> Self {
        self.if_there.extend(names.into_iter().map(str::to_owned));
        self
    }

    /// And it changes these dimensions of the records.
    #[must_use]
    pub fn changes<'a>(mut self, names: impl IntoIterator<Item = &'a str>) -> Self {
        self.changes.extend(names.into_iter().map(str::to_owned));
        self
    }

    /// And it reads a column.
    #[must_use]
    pub fn reads<T: ColumnValue>(mut self, column: &Column<T>) -> Self {
        self.reads.push(column.kind());
        self
    }

    /// And it reads a column of the `neighbors` nearest other positions, and of its own.
    #[must_use]
    pub fn reads_of_neighbors<T: ColumnValue>(self, column: &Column<T>, neighbors: usize) -> Self {
        let mut needs = self.reads(column).neighbors(neighbors);
        needs.of_neighbors.push(column.kind());
        needs
    }

    /// And it computes a column.
    #[must_use]
    pub fn writes<T: ColumnValue>(mut self, column: &Column<T>) -> Self {
        self.writes.push(column.kind());
        self
    }

    /// And each result is computed from so many nearest other positions, at least.
    #[must_use]
    pub fn neighbors(mut self, neighbors: usize) -> Self {
        self.neighbors = self.neighbors.max(neighbors);
        self
    }

    /// And it works with so many bytes more for each position of the tile, rim included.
    #[must_use]
    pub fn bytes_per_point(mut self, bytes: usize) -> Self {
        self.bytes_per_point += bytes;
        self
    }

    /// And it holds so many bytes for each position of the scan, from the end of its first phase
    /// on; the plan refuses scans for which the memory does not do. Said by what the [first
    /// phase](crate::stage::ScanOp::gather_needs) needs.
    #[must_use]
    pub fn holds(mut self, bytes: usize) -> Self {
        self.of_scan += bytes;
        self
    }

    /// And it holds so many bytes then besides, whatever the scan.
    #[must_use]
    pub fn holds_besides(mut self, bytes: u64) -> Self {
        self.of_any_scan = self.of_any_scan.saturating_add(bytes);
        self
    }

    /// And it decides about the points of cells together, of a side of so many lattice steps (0
    /// while that is not settled); `aligned` if they are octree nodes.
    #[must_use]
    pub fn cells(mut self, side: i64, aligned: bool) -> Self {
        (self.cells, self.cell_side, self.cell_aligned) = (true, side, aligned);
        self
    }

    /// And it reads the tile's partition into cells.
    #[must_use]
    pub fn takes_cells(mut self) -> Self {
        self.takes_cells = true;
        self
    }

    /// And it makes the tile's partition into cells.
    #[must_use]
    pub fn makes_cells(mut self) -> Self {
        self.makes_cells = true;
        self
    }

    /// And it reads the numbers that records have in the input, which are known where every record
    /// still comes in the order of the input.
    #[must_use]
    pub fn reads_record_numbers(mut self) -> Self {
        self.record_numbers = true;
        self
    }

    /// And any byte of a record may decide what it does with it.
    #[must_use]
    pub fn reads_whole_records(mut self) -> Self {
        self.whole_records = true;
        self
    }

    /// And it removes points, or marks them instead.
    #[must_use]
    pub fn removes(mut self, mark: Option<Mark>) -> Self {
        (self.removes, self.mark) = (mark.is_none(), mark);
        self
    }

    /// And it says of what it removes [how far](crate::tile::Fate::Represented) that is from what
    /// stands for it.
    #[must_use]
    pub fn measures(mut self) -> Self {
        self.measures = true;
        self
    }

    /// And it moves points: each record that it decides about is written, and measured in the
    /// report, where the column [`SHIFT`] that it computes takes it. Positions go to whole steps of
    /// the lattice within the box of the scan. No stage that works on tiles can stand behind it,
    /// since all of them work on the positions that were read.
    #[must_use]
    pub fn moves(self) -> Self {
        Needs { moves: true, ..self.writes(&SHIFT) }
    }

    /// The names of all that it reads, for a plan that is shown.
    pub(crate) fn read_names(&self) -> Vec<&str> {
        let cells = self.takes_cells.then_some("Cell");
        let columns = self.reads.iter().map(|column| column.name());
        cells.into_iter().chain(columns).chain(self.dimensions.iter().map(String::as_str)).collect()
    }

    /// The names of all that it gives.
    pub(crate) fn written_names(&self) -> Vec<&str> {
        let cells = self.makes_cells.then_some("Cell");
        let columns = self.writes.iter().map(|column| column.name());
        cells.into_iter().chain(columns).chain(self.changes.iter().map(String::as_str)).collect()
    }

    /// True if it reads `column`.
    pub fn does_read<T: ColumnValue>(&self, column: &Column<T>) -> bool {
        self.reads.contains(&column.kind())
    }
}
