//! What an expression says, before it is known what records and columns there are.

use std::ops::Range;

/// A part of an expression and where it stands in the text.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ExpressionTree {
    pub node: TreeNode,
    pub span: Range<usize>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum TreeNode {
    Number(f64),
    /// A dimension of the records, or a number of a column.
    Name(String),
    Negated(Box<ExpressionTree>),
    Arithmetic(Operator, Box<ExpressionTree>, Box<ExpressionTree>),
    Call(Function, Vec<ExpressionTree>),
    Compared(Relation, Box<ExpressionTree>, Box<ExpressionTree>),
    /// Whether a number is one of these, or in one of these ranges, ends included.
    Among(Box<ExpressionTree>, Vec<(ExpressionTree, ExpressionTree)>),
    IsNan(Box<ExpressionTree>),
    Not(Box<ExpressionTree>),
    All(Vec<ExpressionTree>),
    Any(Vec<ExpressionTree>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Operator {
    Plus,
    Minus,
    Times,
    Over,
    Remainder,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Relation {
    Equal,
    Unequal,
    Less,
    AtMost,
    Greater,
    AtLeast,
}

/// Functions whose results IEEE 754 fixes to the last bit: no other could be the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Function {
    Abs,
    Sqrt,
    Floor,
    Ceil,
    Round,
    Min,
    Max,
}

impl Function {
    pub const NAMES: [&'static str; 7] = ["abs", "sqrt", "floor", "ceil", "round", "min", "max"];

    pub fn named(name: &str) -> Option<Function> {
        use Function as F;
        let all = [F::Abs, F::Sqrt, F::Floor, F::Ceil, F::Round, F::Min, F::Max];
        Function::NAMES.iter().position(|known| *known == name).map(|at| all[at])
    }

    /// How many numbers it takes.
    pub fn takes(self) -> usize {
        if matches!(self, Function::Min | Function::Max) { 2 } else { 1 }
    }
}

impl ExpressionTree {
    /// True if it is true or false; none where that depends on what a name means.
    pub fn is_condition(&self) -> Option<bool> {
        use TreeNode as N;
        match self.node {
            N::Name(_) => None,
            N::Number(_) | N::Negated(_) | N::Arithmetic(..) | N::Call(..) => Some(false),
            _ => Some(true),
        }
    }

    /// The parts that it is made of.
    pub fn parts(&self) -> Vec<&ExpressionTree> {
        use TreeNode as N;
        match &self.node {
            N::Number(_) | N::Name(_) => Vec::new(),
            N::Negated(a) | N::IsNan(a) | N::Not(a) => vec![a],
            N::Arithmetic(_, a, b) | N::Compared(_, a, b) => vec![a, b],
            N::Call(_, all) | N::All(all) | N::Any(all) => all.iter().collect(),
            N::Among(a, ranges) => {
                std::iter::once(&**a).chain(ranges.iter().flat_map(|(lo, hi)| [lo, hi])).collect()
            }
        }
    }

    /// The names in it, each once, in the order of the text.
    pub fn names(&self) -> Vec<&str> {
        let mut names = Vec::new();
        self.add_names(&mut names);
        names
    }

    fn add_names<'a>(&'a self, names: &mut Vec<&'a str>) {
        if let TreeNode::Name(name) = &self.node
            && !names.contains(&name.as_str())
        {
            names.push(name);
        }
        self.parts().into_iter().for_each(|part| part.add_names(names));
    }
}
