//! The formulas of rule sets, for example `hip_girth / 2 - 6 cm`: text to a program that the runtime runs. Knows no
//! file; what a name means is told by the caller.
//!
//! ```text
//! condition  = all { "or" all }            all     = comparison { "and" comparison }
//! comparison = sum [ ("<" | "<=" | ">" | ">=") sum ]
//! sum        = product { ("+" | "-") product }
//! product    = factor { ("*" | "/") factor }
//! factor     = "-" factor | number [ unit ] | name | function "(" condition { "," condition } ")" | "(" condition ")"
//! ```

use super::closest;
use super::units::LengthUnit;
use kitsuke::measurement::Measurement;
use kitsuke::tailoring::Op;
use std::ops::Range;

/// Longest formula, bytes.
const BYTES: usize = 2000;
/// How deep brackets may stand in brackets.
const NESTING: usize = 16;

/// What a name in a formula stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symbol {
    /// A measurement of the body.
    Measurement(Measurement),
    /// A dimension or a value of the rule set, by its index.
    Dimension(u16),
}

/// Why a text is no formula.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Which bytes of the text.
    pub span: Range<usize>,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub help: String,
}

/// Compiles a formula that gives a length. `symbols` are the names that it may use.
///
/// # Errors
/// The first mistake.
pub fn compile(text: &str, symbols: &[(&str, Symbol)]) -> Result<Vec<Op>, Mistake> {
    if text.len() > BYTES {
        let help = "Name parts of it under [values] and use these names here.";
        return Err(mistake(0..BYTES, format!("the formula is longer than {BYTES} bytes"), help));
    }
    let tokens = tokens(text)?;
    let mut parser = Parser { text, tokens: &tokens, symbols, next: 0, nesting: 0 };
    let term = parser.condition()?;
    if let Some(token) = parser.peek() {
        return Err(parser.unexpected(token.clone()));
    }
    let found = match term.kind {
        Kind::Length => return Ok(term.ops),
        Kind::Number => "a number without a unit",
        Kind::Condition => "a condition",
    };
    let help = match term.kind {
        Kind::Number => "Write the unit: mm, cm, m, shaku, sun or bu.",
        _ => "Choose between two lengths with if(condition, length, length).",
    };
    Err(mistake(term.span, format!("this is {found}, not a length"), help))
}

/// Whether a word means something in every formula, so that nothing else can be called so.
#[must_use]
pub fn is_reserved(word: &str) -> bool {
    let is_unit = LengthUnit::ALL.iter().any(|unit| unit.name() == word);
    is_unit || ["and", "or"].contains(&word) || FUNCTIONS.iter().any(|(name, _)| *name == word)
}

fn mistake(span: Range<usize>, problem: impl Into<String>, help: impl Into<String>) -> Mistake {
    Mistake { span, problem: problem.into(), help: help.into() }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum TokenKind {
    Number(f64),
    Word,
    Sign,
}

#[derive(Clone, Debug)]
struct Token {
    kind: TokenKind,
    span: Range<usize>,
}

const SIGNS: [&str; 11] = ["<=", ">=", "<", ">", "+", "-", "*", "/", "(", ")", ","];

fn tokens(text: &str) -> Result<Vec<Token>, Mistake> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let run = |is_part: fn(char) -> bool| rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        let (kind, length) = if c.is_whitespace() {
            at += c.len_utf8();
            continue;
        } else if c.is_ascii_digit() || c == '.' {
            let length = run(|c| c.is_ascii_digit() || c == '.');
            let number = rest[..length].parse().ok().filter(|number: &f64| number.is_finite());
            let wrong = || mistake(at..at + length, format!("`{}` is no number", &rest[..length]), "Write 2 or 2.5.");
            (TokenKind::Number(number.ok_or_else(wrong)?), length)
        } else if c.is_alphabetic() || c == '_' {
            (TokenKind::Word, run(|c| c.is_alphanumeric() || c == '_'))
        } else if let Some(sign) = SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
            (TokenKind::Sign, sign.len())
        } else {
            let help = match c {
                '×' => "Multiplication is `*`.",
                '÷' => "Division is `/`.",
                '−' | '–' => "Minus is `-`.",
                '≤' | '≧' | '≦' | '≥' | '=' => "Comparisons are <, <=, > and >=.",
                _ => "Formulas have numbers with units, names, + - * / ( ) , < <= > >=.",
            };
            return Err(mistake(at..at + c.len_utf8(), format!("`{c}` means nothing here"), help));
        };
        tokens.push(Token { kind, span: at..at + length });
        at += length;
    }
    Ok(tokens)
}

/// What a part of a formula gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Length,
    Number,
    Condition,
}

impl Kind {
    const fn name(self) -> &'static str {
        match self {
            Kind::Length => "a length",
            Kind::Number => "a number without a unit",
            Kind::Condition => "a condition",
        }
    }
}

/// A part of a formula, compiled.
struct Term {
    kind: Kind,
    span: Range<usize>,
    ops: Vec<Op>,
}

impl Term {
    /// Two terms and what is done with them.
    fn with(self, other: Term, op: Op, kind: Kind) -> Term {
        let span = self.span.start.min(other.span.start)..self.span.end.max(other.span.end);
        Term { kind, span, ops: [self.ops, other.ops, vec![op]].concat() }
    }
}

/// The functions: name, what it is called with.
const FUNCTIONS: [(&str, &str); 8] = [
    ("min", "min(a, b, ...)"),
    ("max", "max(a, b, ...)"),
    ("if", "if(condition, a, b)"),
    ("if_known", "if_known(measurement, otherwise)"),
    ("round", "round(length, step)"),
    ("round_up", "round_up(length, step)"),
    ("round_down", "round_down(length, step)"),
    ("diagonal", "diagonal(a, b)"),
];

struct Parser<'a> {
    text: &'a str,
    tokens: &'a [Token],
    symbols: &'a [(&'a str, Symbol)],
    next: usize,
    nesting: usize,
}

type Parsed = Result<Term, Mistake>;

impl Parser<'_> {
    fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.next)
    }

    fn word(&self, token: &Token) -> &str {
        &self.text[token.span.clone()]
    }

    /// Steps over the next token if it is one of these; gives it.
    fn take<'w>(&mut self, words: &[&'w str]) -> Option<&'w str> {
        let token = self.peek()?;
        let found = words.iter().copied().find(|word| *word == self.word(token))?;
        self.next += 1;
        Some(found)
    }

    fn unexpected(&self, token: Token) -> Mistake {
        let word = self.word(&token);
        let before = self.next.checked_sub(1).map(|i| self.tokens[i].kind);
        let help = match (before, token.kind) {
            (Some(TokenKind::Number(_)), TokenKind::Sign) if word == "," => "Decimals take a point: 2.5.",
            (Some(TokenKind::Sign), _) => "A number, a name or a bracket belongs here.",
            (_, TokenKind::Word | TokenKind::Number(_)) => "Put + - * or / before it.",
            _ if word == ")" => "There is no bracket that it closes.",
            _ => "Formulas look like `hip_girth / 2 - 6 cm`.",
        };
        mistake(token.span.clone(), format!("`{word}` is not expected here"), help)
    }

    fn condition(&mut self) -> Parsed {
        let mut left = self.all()?;
        while self.take(&["or"]).is_some() {
            let right = self.all()?;
            left = logical(left, right, Op::Maximum, "or")?;
        }
        Ok(left)
    }

    fn all(&mut self) -> Parsed {
        let mut left = self.comparison()?;
        while self.take(&["and"]).is_some() {
            let right = self.comparison()?;
            left = logical(left, right, Op::Minimum, "and")?;
        }
        Ok(left)
    }

    fn comparison(&mut self) -> Parsed {
        let left = self.sum()?;
        let Some(sign) = self.take(&["<=", ">=", "<", ">"]) else { return Ok(left) };
        let right = self.sum()?;
        same_kind(&left, &right, "compared")?;
        Ok(match sign {
            "<=" => left.with(right, Op::LessOrEqual, Kind::Condition),
            "<" => left.with(right, Op::Less, Kind::Condition),
            ">=" => right.with(left, Op::LessOrEqual, Kind::Condition),
            _ => right.with(left, Op::Less, Kind::Condition),
        })
    }

    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        while let Some(sign) = self.take(&["+", "-"]) {
            let right = self.product()?;
            let (op, done) = if sign == "+" { (Op::Add, "added") } else { (Op::Subtract, "subtracted") };
            same_kind(&left, &right, done)?;
            let kind = left.kind;
            left = left.with(right, op, kind);
        }
        Ok(left)
    }

    fn product(&mut self) -> Parsed {
        let mut left = self.factor()?;
        while let Some(sign) = self.take(&["*", "/"]) {
            let right = self.factor()?;
            let is_product = sign == "*";
            let kind = match (left.kind, right.kind) {
                (Kind::Number, Kind::Number) => Kind::Number,
                (Kind::Length, Kind::Number) => Kind::Length,
                (Kind::Number, Kind::Length) if is_product => Kind::Length,
                (Kind::Length, Kind::Length) if !is_product => Kind::Number,
                (a, b) => {
                    let (done, help) = match is_product {
                        true => ("times", "Multiply a length by a number without a unit."),
                        false => ("divided by", "Divide a length by a number, or by a length."),
                    };
                    let span = left.span.start..right.span.end;
                    return Err(mistake(span, format!("{} {done} {} is no length", a.name(), b.name()), help));
                }
            };
            left = left.with(right, if is_product { Op::Multiply } else { Op::Divide }, kind);
        }
        Ok(left)
    }

    fn factor(&mut self) -> Parsed {
        let Some(token) = self.peek().cloned() else {
            let end = self.text.len();
            return Err(mistake(end..end, "the formula stops here", "A number, a name or a bracket belongs here."));
        };
        if self.nesting == NESTING {
            let problem = format!("more than {NESTING} brackets or signs stand in one another here");
            return Err(mistake(token.span, problem, "Name parts of it under [values] and use these names here."));
        }
        self.nesting += 1;
        let term = match token.kind {
            TokenKind::Number(value) => {
                self.next += 1;
                self.number(value, token.span)
            }
            TokenKind::Word => {
                self.next += 1;
                if self.take(&["("]).is_some() { self.function(token) } else { self.name(token) }
            }
            TokenKind::Sign if self.take(&["-"]).is_some() => self.factor().and_then(|term| match term.kind {
                Kind::Condition => Err(mistake(term.span, "a condition has no sign", "Put the sign before a length.")),
                kind => {
                    let zero = Term { kind, span: token.span, ops: vec![Op::Constant(0.0)] };
                    Ok(zero.with(term, Op::Subtract, kind))
                }
            }),
            TokenKind::Sign if self.take(&["("]).is_some() => self.condition().and_then(|term| {
                let end = self.close(&token)?;
                Ok(Term { span: token.span.start..end, ..term })
            }),
            TokenKind::Sign => Err(self.unexpected(token)),
        };
        self.nesting -= 1;
        term
    }

    /// Steps over the bracket that closes `open`; gives where it ends.
    fn close(&mut self, open: &Token) -> Result<usize, Mistake> {
        if self.take(&[")"]).is_some() {
            return Ok(self.tokens[self.next - 1].span.end);
        }
        match self.peek() {
            Some(token) => Err(self.unexpected(token.clone())),
            None => Err(mistake(open.span.clone(), "this bracket is not closed", "Write `)` where it ends.")),
        }
    }

    fn number(&mut self, value: f64, span: Range<usize>) -> Parsed {
        let constant = |kind, value: f64, span| Ok(Term { kind, span, ops: vec![Op::Constant(value as f32)] });
        let Some(token) = self.peek().filter(|token| token.kind == TokenKind::Word).cloned() else {
            return constant(Kind::Number, value, span);
        };
        let word = self.word(&token);
        if let Some(unit) = LengthUnit::ALL.into_iter().find(|unit| unit.name() == word) {
            self.next += 1;
            return constant(Kind::Length, value * unit.metres(), span.start..token.span.end);
        }
        if ["and", "or"].contains(&word) {
            return constant(Kind::Number, value, span);
        }
        let number = &self.text[span];
        let is_name = self.symbols.iter().any(|(name, _)| *name == word) || FUNCTIONS.iter().any(|(f, _)| *f == word);
        let (problem, help) = match is_name {
            true => (format!("between {number} and `{word}` stands nothing"), format!("Write `{number} * {word}`.")),
            false => (format!("`{word}` is no unit"), "Units are mm, cm, m, shaku, sun and bu.".to_owned()),
        };
        Err(mistake(token.span, problem, help))
    }

    fn name(&mut self, token: Token) -> Parsed {
        let word = self.word(&token);
        match self.symbols.iter().find(|(name, _)| *name == word) {
            Some((_, Symbol::Measurement(measurement))) => {
                Ok(Term { kind: Kind::Length, span: token.span, ops: vec![Op::Measurement(*measurement)] })
            }
            Some((_, Symbol::Dimension(index))) => {
                Ok(Term { kind: Kind::Length, span: token.span, ops: vec![Op::Dimension(*index)] })
            }
            None => {
                let names = || self.symbols.iter().map(|(name, _)| *name);
                let has_part = || names().find(|name| name.split('_').any(|part| part == word));
                let help = match has_part().or_else(|| closest(word, names())) {
                    Some(similar) => format!("Is `{similar}` meant?"),
                    None => "Names are those of measurements, dimensions and [values].".to_owned(),
                };
                Err(mistake(token.span.clone(), format!("nothing is called `{word}`"), help))
            }
        }
    }

    /// What follows the opening bracket of a function.
    fn function(&mut self, token: Token) -> Parsed {
        let called = self.word(&token).to_owned();
        let Some(&(name, usage)) = FUNCTIONS.iter().find(|(name, _)| *name == called) else {
            let help = match closest(&called, FUNCTIONS.iter().map(|(name, _)| *name)) {
                Some(similar) => format!("Is `{similar}` meant?"),
                None => format!("Functions are {}.", FUNCTIONS.map(|(name, _)| name).join(", ")),
            };
            return Err(mistake(token.span, format!("there is no function `{called}`"), help));
        };
        let mut given = vec![self.condition()?];
        while self.take(&[","]).is_some() {
            given.push(self.condition()?);
        }
        let open = Token { span: token.span.start..token.span.end + 1, ..token };
        let span = open.span.start..self.close(&open)?;
        let usage = || format!("It is called as {usage}.");
        let wrong = |problem: String| Err(mistake(span.clone(), problem, usage()));
        let is_right_count = match name {
            "min" | "max" => given.len() >= 2,
            "if" => given.len() == 3,
            _ => given.len() == 2,
        };
        if !is_right_count {
            return wrong(format!("`{name}` cannot take {} values", given.len()));
        }
        let mut rest = given.into_iter();
        let mut next = || rest.next().expect("the values were counted");
        let first = next();
        let mut term = match name {
            "if" => {
                if first.kind != Kind::Condition {
                    return Err(mistake(first.span, "this is no condition", "Compare two lengths with < <= > or >=."));
                }
                let (yes, no) = (next(), next());
                same_kind(&yes, &no, "chosen from")?;
                Term { kind: yes.kind, span: 0..0, ops: [first.ops, yes.ops, no.ops, vec![Op::Select]].concat() }
            }
            "if_known" => {
                let [Op::Measurement(measurement)] = first.ops[..] else {
                    return Err(mistake(first.span, "this is no measurement", usage()));
                };
                let otherwise = next();
                same_kind(&first, &otherwise, "chosen from")?;
                Term { ops: [otherwise.ops, vec![Op::IfKnown(measurement)]].concat(), ..first }
            }
            _ => {
                let op = match name {
                    "min" => Op::Minimum,
                    "max" => Op::Maximum,
                    "round" => Op::Round,
                    "round_up" => Op::RoundUp,
                    "round_down" => Op::RoundDown,
                    _ => Op::Hypotenuse,
                };
                rest.try_fold(first, |left, right| {
                    same_kind(&left, &right, "put together")?;
                    let kind = left.kind;
                    Ok(left.with(right, op, kind))
                })?
            }
        };
        if term.kind == Kind::Condition {
            return wrong(format!("`{name}` cannot take conditions"));
        }
        term.span = span.clone();
        Ok(term)
    }
}

fn same_kind(a: &Term, b: &Term, done: &str) -> Result<(), Mistake> {
    let (wrong, help) = match (a.kind, b.kind) {
        (Kind::Condition, _) => (a, "Conditions stand in if(condition, a, b)."),
        (_, Kind::Condition) => (b, "Conditions stand in if(condition, a, b)."),
        (Kind::Number, Kind::Length) => (a, "Write the unit of the number: mm, cm, m, shaku, sun or bu."),
        (Kind::Length, Kind::Number) => (b, "Write the unit of the number: mm, cm, m, shaku, sun or bu."),
        _ => return Ok(()),
    };
    Err(mistake(wrong.span.clone(), format!("{} and {} cannot be {done}", a.kind.name(), b.kind.name()), help))
}

fn logical(a: Term, b: Term, op: Op, word: &str) -> Parsed {
    for term in [&a, &b] {
        if term.kind != Kind::Condition {
            let problem = format!("`{word}` joins conditions, and this is {}", term.kind.name());
            return Err(mistake(term.span.clone(), problem, "Compare two lengths with < <= > or >=."));
        }
    }
    Ok(a.with(b, op, Kind::Condition))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kitsuke::measurement::Measurements;
    use kitsuke::tailoring::{DimensionRule, RuleSet};
    use proptest::prelude::*;

    const SYMBOLS: [(&str, Symbol); 3] = [
        ("hip_girth", Symbol::Measurement(Measurement::HipGirth)),
        ("neck_girth", Symbol::Measurement(Measurement::NeckGirth)),
        ("yuki", Symbol::Dimension(0)),
    ];

    /// What a formula gives for a hip of 90 cm and a yuki of 66 cm, cm.
    fn cm(text: &str) -> f32 {
        let rule = |program| DimensionRule { name: String::from("d"), ja: String::new(), program };
        let yuki = DimensionRule { name: "yuki".to_owned(), ..rule(vec![Op::Constant(0.66)]) };
        let program = compile(text, &SYMBOLS).unwrap_or_else(|mistake| panic!("{text}: {mistake:?}"));
        let rules = RuleSet { name: "r".to_owned(), dimensions: vec![yuki, rule(program)], ..RuleSet::default() };
        rules.validate().unwrap();
        let body = Measurements::default().with(Measurement::HipGirth, 0.9);
        rules.dimensions(&body).unwrap().0[1] * 100.0
    }

    #[test]
    fn formulas_give_what_they_say() {
        for (text, expected) in [
            ("hip_girth / 2 - 6 cm", 39.0),
            ("hip_girth/2-6cm", 39.0),
            ("1.3 shaku", 49.244),
            ("2 sun + 5 bu - 10 mm", 8.47),
            ("(hip_girth - (hip_girth / 2 - 6 cm) + 6 cm) / 2", 28.5),
            ("10 cm - 3 cm - 2 cm", 5.0),
            ("12 cm / 2 / 3", 2.0),
            ("2 * 3 cm + 4 cm * 5", 26.0),
            ("-3 cm - -4 cm", 1.0),
            ("hip_girth * (yuki / hip_girth)", 66.0),
            ("min(3 cm, 1 cm, 2 cm) + max(3 cm, 1 cm, 5 cm)", 6.0),
            ("if(hip_girth >= 90 cm, 1 cm, 2 cm)", 1.0),
            ("if(hip_girth > 90 cm, 1 cm, 2 cm)", 2.0),
            ("if(hip_girth <= 90 cm, 1 cm, 2 cm)", 1.0),
            ("if(hip_girth < 90 cm, 1 cm, 2 cm)", 2.0),
            ("if(1 cm > 2 cm or 3 cm < 4 cm and 1 < 2, 1 cm, 2 cm)", 1.0),
            ("if((1 cm < 2 cm or 3 cm < 4 cm) and 2 < 1, 1 cm, 2 cm)", 2.0),
            ("if_known(hip_girth, 1 cm)", 90.0),
            ("if_known(neck_girth, 1 cm)", 1.0),
            ("round(yuki, 5 cm)", 65.0),
            ("round_up(yuki, 5 cm)", 70.0),
            ("round_down(yuki, 5 cm)", 65.0),
            ("diagonal(3 cm, 4 cm)", 5.0),
        ] {
            let found = cm(text);
            assert!((found - expected).abs() < 1e-4, "{text}: {found}");
        }
    }

    #[test]
    fn mistakes_are_found_where_they_are() {
        for (text, part, problem) in [
            ("hip_girth / 2 - 6", "6", "a length and a number without a unit cannot be subtracted"),
            ("2 + hip_girth", "2", "a number without a unit and a length cannot be added"),
            ("3", "3", "this is a number without a unit, not a length"),
            ("hip_girth > 2 cm", "hip_girth > 2 cm", "this is a condition, not a length"),
            ("hip_girth * 2 cm", "hip_girth * 2 cm", "a length times a length is no length"),
            ("2 / 3 cm", "2 / 3 cm", "a number without a unit divided by a length is no length"),
            ("hip / 2", "hip", "nothing is called `hip`"),
            ("hip_grith / 2", "hip_grith", "nothing is called `hip_grith`"),
            ("0.4 hip_girth", "hip_girth", "between 0.4 and `hip_girth` stands nothing"),
            ("2 inch", "inch", "`inch` is no unit"),
            ("2,5 cm", ",", "`,` is not expected here"),
            ("1.2.3 cm", "1.2.3", "`1.2.3` is no number"),
            ("2 cm +", "", "the formula stops here"),
            ("", "", "the formula stops here"),
            ("(2 cm", "(", "this bracket is not closed"),
            ("2 cm)", ")", "`)` is not expected here"),
            ("2 cm 3 cm", "3", "`3` is not expected here"),
            ("hip_girth ÷ 2", "÷", "`÷` means nothing here"),
            ("maks(1 cm, 2 cm)", "maks", "there is no function `maks`"),
            ("max(1 cm)", "max(1 cm)", "`max` cannot take 1 values"),
            ("if(2 cm, 1 cm, 3 cm)", "2 cm", "this is no condition"),
            ("if(1 < 2, 1 cm, 3)", "3", "a length and a number without a unit cannot be chosen from"),
            ("if_known(yuki, 2 cm)", "yuki", "this is no measurement"),
            ("1 cm or 2 cm", "1 cm", "`or` joins conditions, and this is a length"),
            ("-(1 < 2)", "(1 < 2)", "a condition has no sign"),
        ] {
            let mistake = compile(text, &SYMBOLS).expect_err(text);
            assert_eq!((&text[mistake.span], mistake.problem.as_str()), (part, problem), "{text}");
            assert!(!mistake.help.is_empty());
        }
    }

    #[test]
    fn names_that_are_nearly_right_are_offered() {
        for (text, help) in [
            ("hip", "Is `hip_girth` meant?"),
            ("girth / 2", "Is `hip_girth` meant?"),
            ("hip_grith", "Is `hip_girth` meant?"),
            ("Yuki", "Is `yuki` meant?"),
            ("rund(1 cm, 1 mm)", "Is `round` meant?"),
            ("2 yuki", "Write `2 * yuki`."),
        ] {
            assert_eq!(compile(text, &SYMBOLS).expect_err(text).help, help, "{text}");
        }
    }

    #[test]
    fn hostile_formulas_are_refused() {
        let nested = |depth| format!("{}1 cm{}", "(".repeat(depth), ")".repeat(depth));
        assert!(compile(&nested(NESTING - 1), &SYMBOLS).is_ok());
        assert!(compile(&nested(NESTING), &SYMBOLS).is_err());
        assert!(compile(&"-".repeat(1500), &SYMBOLS).is_err());
        assert!(compile(&"(".repeat(BYTES + 1), &SYMBOLS).is_err());
        assert!(compile(&format!("{} cm", "9".repeat(400)), &SYMBOLS).is_err());
    }

    /// A formula and what it gives, computed on the way.
    fn formulas() -> impl Strategy<Value = (String, f64)> {
        let leaf = prop_oneof![
            (1..1000u32).prop_map(|mm| (format!("{mm} mm"), f64::from(mm) / 1000.0)),
            Just(("hip_girth".to_owned(), 0.9)),
            Just(("yuki".to_owned(), 0.66)),
        ];
        leaf.prop_recursive(4, 32, 3, |inner| {
            let two = (inner.clone(), inner.clone());
            prop_oneof![
                two.clone().prop_map(|((a, x), (b, y))| (format!("({a} + {b})"), x + y)),
                two.clone().prop_map(|((a, x), (b, y))| (format!("{a} - ({b})"), x - y)),
                two.clone().prop_map(|((a, x), (b, y))| (format!("max({a}, {b})"), x.max(y))),
                two.clone().prop_map(|((a, x), (b, y))| (format!("min({a}, {b})"), x.min(y))),
                two.prop_map(|((a, x), (b, y))| (format!("diagonal({a}, {b})"), x.hypot(y))),
                inner.clone().prop_map(|(a, x)| (format!("-({a}) * 0.5"), -x * 0.5)),
                (inner, 1..9u32).prop_map(|((a, x), n)| (format!("({a}) / {n}"), x / f64::from(n))),
            ]
        })
    }

    proptest! {
        #[test]
        fn compiled_formulas_compute_what_was_written((text, expected_m) in formulas()) {
            match compile(&text, &SYMBOLS) {
                Ok(_) => prop_assert!((f64::from(cm(&text)) / 100.0 - expected_m).abs() < 1e-5 * (1.0 + expected_m.abs())),
                Err(mistake) => prop_assert!(mistake.problem.starts_with("more than 16"), "{text}: {mistake:?}"),
            }
        }

        #[test]
        fn any_text_is_compiled_or_refused(text in "[-+*/(),<>=.0-9a-z_ 袖cm]{0,60}") {
            if let Err(mistake) = compile(&text, &SYMBOLS) {
                prop_assert!(text.get(mistake.span).is_some());
            }
        }
    }
}
