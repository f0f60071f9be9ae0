//! Well-known text as a tree, and its keywords for systems. Knows nothing of what they mean.

/// A text with brackets nested deeper is none of a coordinate reference system.
const DEEPEST: usize = 64;
/// Brackets that are looked into; a system has some hundreds.
const MOST_NODES: usize = 20_000;

/// Keywords of systems, in WKT 1 and 2 and as ESRI has them: of several in one.
pub const COMPOUND: [&str; 2] = ["COMPD_CS", "COMPOUNDCRS"];
/// Of heights.
pub const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
/// Of a plane.
pub const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
/// Of longitude and latitude, in WKT 2 also of the three axes of the Earth.
pub const GEODETIC: [&str; 5] = ["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS"];
/// Of other axes.
pub const LOCAL: [&str; 4] = ["GEOCCS", "LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"];
/// With a way to another.
pub const BOUND: [&str; 1] = ["BOUNDCRS"];
/// All that are no compounds.
pub const SYSTEMS: [&[&str]; 5] = [&VERTICAL, &PROJECTED, &GEODETIC, &LOCAL, &BOUND];
/// Of units of length.
pub const LENGTH: [&str; 2] = ["LENGTHUNIT", "UNIT"];

/// The single systems of `trees`: those of compounds for each.
pub fn parts(trees: &[WktNode]) -> Vec<&WktNode> {
    let mut all = Vec::new();
    for tree in trees {
        match tree.is(&COMPOUND) {
            // Beside the parts there are identifiers and remarks.
            true => all.extend(tree.inner.iter().filter(|node| SYSTEMS.iter().any(|w| node.is(w)))),
            false => all.push(tree),
        }
    }
    all
}

/// `WORD["text", number, WORD[…], …]`.
#[derive(Debug, Default)]
pub struct WktNode {
    /// The keyword as written.
    pub word: String,
    /// Texts and numbers inside, as written, quotes off.
    pub values: Vec<String>,
    /// Nodes inside.
    pub inner: Vec<WktNode>,
}

impl WktNode {
    /// True if its keyword is one of these.
    pub fn is(&self, words: &[&str]) -> bool {
        words.iter().any(|word| self.word.eq_ignore_ascii_case(word))
    }

    /// The first node inside with one of these keywords.
    pub fn find(&self, words: &[&str]) -> Option<&WktNode> {
        self.inner.iter().find(|node| node.is(words))
    }

    /// Its own EPSG code.
    pub fn epsg(&self) -> Option<u32> {
        let [authority, code, ..] = &self.find(&["AUTHORITY", "ID"])?.values[..] else {
            return None;
        };
        if authority.eq_ignore_ascii_case("EPSG") { code.parse().ok() } else { None }
    }

    /// True if both are of one wording.
    pub fn is_like(&self, other: &WktNode) -> bool {
        let number = |text: &str| text.parse::<f64>().ok();
        let same = |(one, two): (&String, &String)| {
            one == two || number(one).is_some_and(|one| number(two) == Some(one))
        };
        self.is(&[&other.word])
            && (self.values.len(), self.inner.len()) == (other.values.len(), other.inner.len())
            && self.values.iter().zip(&other.values).all(same)
            && self.inner.iter().zip(&other.inner).all(|(one, two)| one.is_like(two))
    }
}

/// The outermost nodes of `text`, mostly one: some writers put the system of z behind that of x and
/// y. None if a bracket is left open, or there is something outside of them.
pub fn parse(text: &str) -> Option<Vec<WktNode>> {
    let (mut trees, mut open) = (Vec::new(), Vec::<WktNode>::new());
    let mut word = String::new();
    let mut nodes = 0;
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '[' | '(' => {
                nodes += 1;
                if open.len() == DEEPEST || nodes > MOST_NODES {
                    return None;
                }
                let word = std::mem::take(&mut word);
                open.push(WktNode { word: word.trim().to_owned(), ..WktNode::default() });
            }
            // Some writers close a compound before its second part, and once more behind it.
            ',' | ']' | ')' if open.is_empty() && word.trim().is_empty() => word.clear(),
            ']' | ')' | ',' => {
                let node = open.last_mut()?;
                let value = std::mem::take(&mut word);
                if !value.trim().is_empty() {
                    node.values.push(value.trim().to_owned());
                }
                if letter != ',' {
                    let done = open.pop()?;
                    match open.last_mut() {
                        Some(outer) => outer.inner.push(done),
                        None => trees.push(done),
                    }
                }
            }
            '"' => {
                // A doubled quote is one inside the text.
                while let Some(letter) = letters.next() {
                    if letter == '"' && letters.next_if_eq(&'"').is_none() {
                        break;
                    }
                    word.push(letter);
                }
            }
            _ => word.push(letter),
        }
    }
    (open.is_empty() && word.trim().is_empty() && !trees.is_empty()).then_some(trees)
}

/// The unit of length of `node`, or of its first axis.
pub fn length_unit(node: &WktNode) -> Option<&WktNode> {
    node.find(&LENGTH).or_else(|| node.find(&["AXIS"]).and_then(|axis| axis.find(&LENGTH)))
}

/// Metres in a unit; None for what cannot be, such as a foot of one metre, which some writers name.
pub fn factor(unit: &WktNode) -> Option<f64> {
    let factor: f64 = unit.values.get(1)?.parse().ok()?;
    let name = unit.values.first()?.to_ascii_lowercase();
    let foot = ["foot", "feet", "ft"].iter().any(|word| name.contains(word));
    let possible = factor.is_finite() && factor > 0.0 && (!foot || (0.29..0.32).contains(&factor));
    possible.then_some(factor)
}
