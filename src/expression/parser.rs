//! From a text to the tree of an expression, by precedence: `or`, `and`, `not`, comparisons, sums,
//! products, signs.

use std::ops::Range;

use super::fault::{ExpressionFault, quoted};
use super::lexer::{Token, TokenKind, UNITLESS, tokens};
use super::rules::{DEEPEST, condition, depth, direction, not, number, relation, too_deep};
use super::tree::{ExpressionTree, Function, Operator, TreeNode};

/// Words behind a number that are meant for its unit.
const UNITS: [&str; 8] = ["m", "cm", "mm", "km", "ft", "deg", "rad", "meters"];

/// Words that are no names.
const WORDS: [&str; 6] = ["and", "or", "not", "in", "is", "nan"];

/// Reads all of `text` as an expression.
pub(super) fn parse(text: &str) -> Result<ExpressionTree, ExpressionFault> {
    let mut parser = Parser { tokens: tokens(text)?, at: 0, depth: 0 };
    if parser.tokens.len() == 1 {
        return Err(ExpressionFault::new(0..text.len(), "the expression is empty"));
    }
    parser.whole()
}

/// Reads `text` as `name = expression`; the name with its place.
pub(super) fn parse_assignment(
    text: &str,
) -> Result<(String, Range<usize>, ExpressionTree), ExpressionFault> {
    let mut parser = Parser { tokens: tokens(text)?, at: 0, depth: 0 };
    let help = "write NAME = VALUE, such as `Classification = 7`";
    let span = parser.peek().span.clone();
    let name = match parser.next().kind {
        TokenKind::Name(name) => name,
        TokenKind::Word(name) if !WORDS.contains(&name.as_str()) => name,
        _ => return Err(ExpressionFault::new(span, "a dimension is assigned").help(help)),
    };
    if !parser.takes("=") {
        let at = parser.peek().span.clone();
        let told = match parser.peek().kind {
            TokenKind::Sign("==") => "`==` compares",
            _ => "there is no `=` behind the dimension",
        };
        return Err(ExpressionFault::new(at, told).help(help));
    }
    Ok((name, span, parser.whole()?))
}

struct Parser {
    tokens: Vec<Token>,
    at: usize,
    depth: usize,
}

type Parsed = Result<ExpressionTree, ExpressionFault>;

impl Parser {
    fn peek(&self) -> &Token {
        &self.tokens[self.at.min(self.tokens.len() - 1)]
    }

    fn next(&mut self) -> Token {
        let token = self.peek().clone();
        self.at += 1;
        token
    }

    /// True if the next token is this sign or word, which is taken then.
    fn takes(&mut self, text: &str) -> bool {
        let is = match &self.peek().kind {
            TokenKind::Sign(sign) => *sign == text,
            TokenKind::Word(word) => word == text,
            _ => false,
        };
        self.at += usize::from(is);
        is
    }

    fn needs(&mut self, sign: &str, of: &Range<usize>) -> Result<(), ExpressionFault> {
        if self.takes(sign) {
            return Ok(());
        }
        if sign == ")" && self.takes(",") {
            let told = "a list stands in brackets, as in `Classification in [2, 6]`";
            return Err(ExpressionFault::new(of.clone(), told));
        }
        let told = format!("there is no `{sign}` that closes this");
        Err(ExpressionFault::new(of.clone(), told))
    }

    fn end(&self) -> Result<(), ExpressionFault> {
        let token = self.peek();
        let told = match &token.kind {
            TokenKind::End => return Ok(()),
            TokenKind::Sign("=") => {
                let told = "`=` assigns";
                return Err(ExpressionFault::new(token.span.clone(), told).help("write `==`"));
            }
            TokenKind::Sign(sign) => format!("`{sign}` does not belong here"),
            TokenKind::Word(word) | TokenKind::Name(word) => {
                format!("there is no sign before `{word}`")
            }
            TokenKind::Number(_) => "there is no sign before this number".to_owned(),
        };
        let words = ["and", "or", "==", "<", "in"];
        let is_number = |token: &Token| matches!(token.kind, TokenKind::Number(_));
        let is_unit =
            matches!(&token.kind, TokenKind::Word(word) if UNITS.contains(&word.as_str()));
        let behind_number = self.at.checked_sub(1).is_some_and(|at| is_number(&self.tokens[at]));
        let help = match is_unit && behind_number {
            true => UNITLESS.to_owned(),
            false => format!("{} may stand there", quoted(words)),
        };
        Err(ExpressionFault::new(token.span.clone(), told).help(help))
    }

    /// All that is left, as one expression.
    fn whole(&mut self) -> Parsed {
        let tree = self.any()?;
        self.end()?;
        match depth(&tree) {
            0..=DEEPEST => Ok(tree),
            _ => Err(too_deep(tree.span)),
        }
    }

    /// Parses one level down.
    fn deeper(&mut self, parse: impl Fn(&mut Self) -> Parsed) -> Parsed {
        if self.depth == DEEPEST {
            return Err(too_deep(self.peek().span.clone()));
        }
        self.depth += 1;
        let parsed = parse(self);
        self.depth -= 1;
        parsed
    }

    fn any(&mut self) -> Parsed {
        self.deeper(|parser| parser.several("or", Parser::all, TreeNode::Any))
    }

    fn all(&mut self) -> Parsed {
        self.several("and", Parser::negated, TreeNode::All)
    }

    fn several(
        &mut self,
        word: &str,
        part: fn(&mut Self) -> Parsed,
        all: fn(Vec<ExpressionTree>) -> TreeNode,
    ) -> Parsed {
        let mut parts = vec![part(self)?];
        while self.takes(word) {
            parts.push(part(self)?);
        }
        match parts.len() {
            1 => Ok(parts.remove(0)),
            _ => {
                parts.iter().try_for_each(condition)?;
                let span = parts[0].span.start..parts[parts.len() - 1].span.end;
                Ok(ExpressionTree { node: all(parts), span })
            }
        }
    }

    fn negated(&mut self) -> Parsed {
        let start = self.peek().span.start;
        if !self.takes("not") {
            return self.compared();
        }
        let part = self.deeper(Parser::negated)?;
        condition(&part)?;
        let span = start..part.span.end;
        Ok(ExpressionTree { node: TreeNode::Not(Box::new(part)), span })
    }

    /// A comparison, a chain of comparisons in one direction (`1 <= Z < 2`), a membership, or a
    /// number.
    fn compared(&mut self) -> Parsed {
        let first = self.sum()?;
        let start = first.span.start;
        let negated = self.takes("not");
        if self.takes("in") {
            number(&first)?;
            let among = self.among(first)?;
            return Ok(if negated { not(among, start) } else { among });
        }
        if negated {
            let told = "`not` stands before a condition, or before `in`";
            return Err(ExpressionFault::new(self.tokens[self.at - 1].span.clone(), told));
        }
        if self.takes("is") {
            let negated = self.takes("not");
            if !self.takes("nan") {
                let told = "`is` is followed by `nan` or `not nan`";
                let help = "numbers are compared by `==`";
                return Err(ExpressionFault::new(self.peek().span.clone(), told).help(help));
            }
            number(&first)?;
            let span = start..self.tokens[self.at - 1].span.end;
            let node = TreeNode::IsNan(Box::new(first));
            let is = ExpressionTree { node, span };
            return Ok(if negated { not(is, start) } else { is });
        }
        self.chain(first)
    }

    fn chain(&mut self, first: ExpressionTree) -> Parsed {
        let start = first.span.start;
        let (mut left, mut links, mut before) = (first, Vec::new(), None);
        while let Some(relation) = relation(&self.peek().kind) {
            let sign = self.next().span;
            number(&left)?;
            let right = self.sum()?;
            number(&right)?;
            if before.is_some_and(|before| direction(before) != direction(relation))
                || before.is_some() && direction(relation) == 0
            {
                let told = "comparisons in a row go in one direction, as in `1 <= Z < 2`";
                return Err(ExpressionFault::new(sign, told).help("write `and` between them"));
            }
            before = Some(relation);
            let span = left.span.start..right.span.end;
            let (a, b) = (Box::new(left), Box::new(right.clone()));
            links.push(ExpressionTree { node: TreeNode::Compared(relation, a, b), span });
            left = right;
        }
        Ok(match links.len() {
            0 => left,
            1 => links.remove(0),
            _ => ExpressionTree { span: start..left.span.end, node: TreeNode::All(links) },
        })
    }

    /// What stands behind `in`: a range, or a list of numbers and ranges.
    fn among(&mut self, of: ExpressionTree) -> Parsed {
        let (start, open) = (of.span.start, self.peek().span.clone());
        let mut ranges = Vec::new();
        if self.takes("[") {
            while !self.takes("]") {
                ranges.push(self.range(true)?);
                if !self.takes(",") {
                    self.needs("]", &open)?;
                    break;
                }
            }
        } else {
            ranges.push(self.range(false)?);
        }
        let span = start..self.tokens[self.at - 1].span.end;
        if ranges.is_empty() {
            return Err(ExpressionFault::new(open.start..span.end, "the list is empty"));
        }
        Ok(ExpressionTree { node: TreeNode::Among(Box::new(of), ranges), span })
    }

    /// `a..b`, ends included, or a single number where that `may` stand.
    fn range(
        &mut self,
        may_be_single: bool,
    ) -> Result<(ExpressionTree, ExpressionTree), ExpressionFault> {
        let low = self.sum()?;
        number(&low)?;
        if self.takes("..") {
            let high = self.sum()?;
            number(&high)?;
            if let (TreeNode::Number(a), TreeNode::Number(b)) = (&low.node, &high.node)
                && a > b
            {
                let told = "the range ends before it begins";
                return Err(ExpressionFault::new(low.span.start..high.span.end, told));
            }
            return Ok((low, high));
        }
        if may_be_single {
            return Ok((low.clone(), low));
        }
        let told = "`in` is followed by a list or a range";
        let help = "write `in [2, 6]` or `in 2..6`";
        Err(ExpressionFault::new(low.span, told).help(help))
    }

    fn sum(&mut self) -> Parsed {
        let signs = [("+", Operator::Plus), ("-", Operator::Minus)];
        self.arithmetic(&signs, Parser::product)
    }

    fn product(&mut self) -> Parsed {
        let signs = [("*", Operator::Times), ("/", Operator::Over), ("%", Operator::Remainder)];
        self.arithmetic(&signs, Parser::signed)
    }

    fn arithmetic(&mut self, signs: &[(&str, Operator)], part: fn(&mut Self) -> Parsed) -> Parsed {
        let mut left = part(self)?;
        let mut links = 0;
        while let Some((_, operator)) = signs.iter().find(|(sign, _)| self.takes(sign)) {
            number(&left)?;
            links += 1;
            if links > DEEPEST {
                return Err(too_deep(left.span));
            }
            let right = part(self)?;
            number(&right)?;
            let span = left.span.start..right.span.end;
            let node = TreeNode::Arithmetic(*operator, Box::new(left), Box::new(right));
            left = ExpressionTree { node, span };
        }
        Ok(left)
    }

    fn signed(&mut self) -> Parsed {
        let start = self.peek().span.start;
        if !self.takes("-") {
            return self.single();
        }
        let part = self.deeper(Parser::signed)?;
        number(&part)?;
        let span = start..part.span.end;
        Ok(match part.node {
            TreeNode::Number(value) => ExpressionTree { node: TreeNode::Number(-value), span },
            _ => ExpressionTree { node: TreeNode::Negated(Box::new(part)), span },
        })
    }

    fn single(&mut self) -> Parsed {
        let Token { kind, span } = self.next();
        let node = match kind {
            TokenKind::Number(value) => TreeNode::Number(value),
            TokenKind::Name(name) => TreeNode::Name(name),
            TokenKind::Word(word) if self.peek().kind == TokenKind::Sign("(") => {
                return self.call(&word, span);
            }
            TokenKind::Word(word) if !WORDS.contains(&word.as_str()) => TreeNode::Name(word),
            TokenKind::Sign("(") => {
                let inner = self.any()?;
                self.needs(")", &span)?;
                return Ok(inner);
            }
            TokenKind::Word(word) => {
                let told = format!("`{word}` stands where a number or a name belongs");
                let fault = ExpressionFault::new(span, told);
                return Err(match word.as_str() {
                    "nan" => fault.help("nothing equals nan: ask `Z is nan`"),
                    _ => fault,
                });
            }
            TokenKind::Sign(sign) => {
                let told = format!("`{sign}` stands where a number or a name belongs");
                let error = ExpressionFault::new(span, told);
                return Err(if sign == "=" { error.help("write `==`") } else { error });
            }
            TokenKind::End => {
                let fault = ExpressionFault::new(span, "the expression ends too early");
                return Err(fault.help("a number, a name or `(` belongs here"));
            }
        };
        Ok(ExpressionTree { node, span })
    }

    fn call(&mut self, word: &str, span: Range<usize>) -> Parsed {
        let Some(function) = Function::named(word) else {
            let told = match WORDS.contains(&word) {
                true => format!("`{word}` stands where a number or a name belongs"),
                false => format!("there is no function `{word}`"),
            };
            let valid = Function::NAMES.map(str::to_owned);
            return Err(ExpressionFault::word(span, told, word, "functions", &valid));
        };
        let open = self.next().span;
        let mut numbers = Vec::new();
        while !self.takes(")") {
            numbers.push(self.any()?);
            if !self.takes(",") {
                self.needs(")", &open)?;
                break;
            }
        }
        numbers.iter().try_for_each(number)?;
        let all = span.start..self.tokens[self.at - 1].span.end;
        match (function.takes(), numbers.len()) {
            (takes, given) if takes == given => {
                Ok(ExpressionTree { node: TreeNode::Call(function, numbers), span: all })
            }
            (takes, given) => {
                let told = format!("`{word}` takes {takes} numbers, not {given}");
                Err(ExpressionFault::new(all, told.replace(" 1 numbers", " one number")))
            }
        }
    }
}
