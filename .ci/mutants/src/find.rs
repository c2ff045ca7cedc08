//! The mutants of a file: the short and standard list of operators.
//!
//! | what | becomes |
//! | --- | --- |
//! | `+ - * / %`, also with `=` | `- + / * *` |
//! | `& \| << >>`, also with `=` | `\| & >> <<` |
//! | `< <= > >=` | the one with or without equality; its contrary |
//! | `== !=`, `&& \|\|` | the other |
//! | `-x`, `!x` | `x` |
//! | a number c | c + 1 |
//! | condition of `if`, guard of `match` | `true`, `false` |
//! | condition of `while` | `false` |
//! | a statement that calls or assigns | nothing |
//! | `min max`, `first last`, `any all`, and their kin | the other |
//!
//! Left out are tests, what is evaluated while compiling, arguments of macros (texts, assertions), `Display` and
//! `Debug`, and what makes an error.

use proc_macro2::Span;
use std::ops::Range;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr, Stmt, UnOp};

/// How a mutant stands in the sources.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    Expression,
    /// With its semicolon; it is dropped.
    Statement,
}

/// A change of one place.
#[derive(Clone, Debug, PartialEq)]
pub struct Mutant {
    /// Of the file, relative to the folder of the package.
    pub path: String,
    pub line: usize,
    /// Bytes of the file that are replaced.
    pub range: Range<usize>,
    pub form: Form,
    pub mutated: String,
    /// Names it from commit to commit: path, line of text, place within it, what is changed into what, and how many of
    /// the same are before it.
    pub key: String,
}

impl Mutant {
    /// What is replaced, and by what, each on a line.
    pub fn shown(&self, text: &str) -> (String, String) {
        let line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let mutated = if self.form == Form::Statement { "(dropped)".into() } else { line(&self.mutated) };
        (line(&text[self.range.clone()]), mutated)
    }
}

/// All mutants of a file, in the order of their places.
pub fn mutants(path: &str, text: &str) -> Result<Vec<Mutant>, String> {
    let file = syn::parse_file(text).map_err(|error| format!("{path}: {error}"))?;
    let mut finder = Finder { path, text, found: Vec::new() };
    finder.visit_file(&file);
    let mut found = finder.found;
    found.sort_by_key(|mutant| (mutant.range.start, mutant.range.end));
    let mut seen = std::collections::HashMap::new();
    for mutant in &mut found {
        let (original, mutated) = mutant.shown(text);
        let start = text[..mutant.range.start].rfind('\n').map_or(0, |at| at + 1);
        let line = text[start..].lines().next().unwrap_or_default().trim();
        let key = format!("{path} | {line} | {original} | {mutated}");
        let count = seen.entry(key.clone()).or_insert(0_usize);
        *count += 1;
        mutant.key = if *count == 1 { key } else { format!("{key} | {count}") };
    }
    Ok(found)
}

struct Finder<'t> {
    path: &'t str,
    text: &'t str,
    found: Vec<Mutant>,
}

impl Finder<'_> {
    fn of(&self, span: Span) -> &str {
        &self.text[span.byte_range()]
    }

    fn add(&mut self, span: Span, form: Form, mutated: String) {
        let (path, line) = (self.path.to_owned(), span.start().line);
        self.found.push(Mutant { path, line, range: span.byte_range(), form, mutated, key: String::new() });
    }

    fn condition(&mut self, condition: &Expr, values: &[&str]) {
        // (A condition that binds names cannot be replaced.)
        if !binds(condition) {
            for &value in values {
                self.add(condition.span(), Form::Expression, value.into());
            }
        }
    }

    fn number(&mut self, literal: &syn::ExprLit) {
        let mutated = match &literal.lit {
            syn::Lit::Float(float) => {
                float.base10_parse().ok().map(|c: f64| format!("{:?}{}", c + 1.0, float.suffix()))
            }
            syn::Lit::Int(int) => {
                int.base10_parse().ok().map(|n: u64| format!("{}{}", n.saturating_add(1), int.suffix()))
            }
            _ => None,
        };
        if let Some(mutated) = mutated {
            self.add(literal.span(), Form::Expression, mutated);
        }
    }
}

fn swapped(operator: &BinOp) -> &'static [&'static str] {
    match operator {
        BinOp::Add(_) => &["-"],
        BinOp::Sub(_) => &["+"],
        BinOp::Div(_) | BinOp::Rem(_) => &["*"],
        BinOp::Mul(_) => &["/"],
        BinOp::AddAssign(_) => &["-="],
        BinOp::SubAssign(_) => &["+="],
        BinOp::MulAssign(_) => &["/="],
        BinOp::DivAssign(_) | BinOp::RemAssign(_) => &["*="],
        BinOp::BitAnd(_) => &["|"],
        BinOp::BitOr(_) => &["&"],
        BinOp::Shl(_) => &[">>"],
        BinOp::Shr(_) => &["<<"],
        BinOp::BitAndAssign(_) => &["|="],
        BinOp::BitOrAssign(_) => &["&="],
        BinOp::Lt(_) => &["<=", ">="],
        BinOp::Le(_) => &["<", ">"],
        BinOp::Gt(_) => &[">=", "<="],
        BinOp::Ge(_) => &[">", "<"],
        BinOp::Eq(_) => &["!="],
        BinOp::Ne(_) => &["=="],
        BinOp::And(_) => &["||"],
        BinOp::Or(_) => &["&&"],
        _ => &[],
    }
}

const METHODS: [[&str; 2]; 8] = [
    ["min", "max"],
    ["min_by", "max_by"],
    ["min_by_key", "max_by_key"],
    ["first", "last"],
    ["first_mut", "last_mut"],
    ["any", "all"],
    ["floor", "ceil"],
    ["is_some", "is_none"],
];

/// Whether a condition has a `let`.
fn binds(condition: &Expr) -> bool {
    match condition {
        Expr::Let(_) => true,
        Expr::Binary(binary) => binds(&binary.left) || binds(&binary.right),
        _ => false,
    }
}

fn assigns(operator: &BinOp) -> bool {
    matches!(
        operator,
        BinOp::AddAssign(_)
            | BinOp::SubAssign(_)
            | BinOp::MulAssign(_)
            | BinOp::DivAssign(_)
            | BinOp::RemAssign(_)
            | BinOp::BitAndAssign(_)
            | BinOp::BitOrAssign(_)
    )
}

/// Whether an item is compiled for tests, documents or the compiler alone.
fn left_out(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let path = attribute.path();
        let condition = || match &attribute.meta {
            syn::Meta::List(list) => list.tokens.to_string(),
            _ => String::new(),
        };
        path.is_ident("test")
            || (path.is_ident("cfg") && condition().split(|c: char| !c.is_alphanumeric()).any(|word| word == "test"))
    })
}

fn last_name(path: &syn::Path) -> String {
    path.segments.last().map(|segment| segment.ident.to_string()).unwrap_or_default()
}

impl<'ast> Visit<'ast> for Finder<'_> {
    // What is no code, or is evaluated while compiling.
    fn visit_attribute(&mut self, _: &'ast syn::Attribute) {}
    fn visit_type(&mut self, _: &'ast syn::Type) {}
    fn visit_pat(&mut self, _: &'ast syn::Pat) {}
    fn visit_path_arguments(&mut self, _: &'ast syn::PathArguments) {}
    fn visit_item_const(&mut self, _: &'ast syn::ItemConst) {}
    fn visit_item_static(&mut self, _: &'ast syn::ItemStatic) {}
    fn visit_item_enum(&mut self, _: &'ast syn::ItemEnum) {}
    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}
    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !left_out(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !left_out(&item.attrs) && item.sig.constness.is_none() {
            visit::visit_block(self, &item.block);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !left_out(&item.attrs) && item.sig.constness.is_none() {
            visit::visit_block(self, &item.block);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        let name = item.trait_.as_ref().map(|(_, path, _)| last_name(path)).unwrap_or_default();
        if !left_out(&item.attrs) && !["Display", "Debug", "Error"].contains(&name.as_str()) {
            visit::visit_item_impl(self, item);
        }
    }

    fn visit_expr_repeat(&mut self, repeat: &'ast syn::ExprRepeat) {
        self.visit_expr(&repeat.expr);
    }

    fn visit_expr_struct(&mut self, literal: &'ast syn::ExprStruct) {
        let error = literal.path.segments.iter().any(|segment| segment.ident.to_string().contains("Error"));
        if !error {
            visit::visit_expr_struct(self, literal);
        }
    }

    fn visit_expr_call(&mut self, call: &'ast syn::ExprCall) {
        let error = match &*call.func {
            Expr::Path(path) => {
                last_name(&path.path) == "Err" || path.path.segments.first().is_some_and(|first| first.ident == "Error")
            }
            _ => false,
        };
        if !error {
            visit::visit_expr_call(self, call);
        }
    }

    fn visit_stmt(&mut self, statement: &'ast Stmt) {
        if let Stmt::Expr(expression, Some(_)) = statement {
            let dropped = match expression {
                Expr::Call(_) | Expr::MethodCall(_) | Expr::Assign(_) | Expr::Try(_) => true,
                Expr::Binary(binary) => assigns(&binary.op),
                _ => false,
            };
            if dropped {
                self.add(statement.span(), Form::Statement, String::new());
            }
        }
        visit::visit_stmt(self, statement);
    }

    fn visit_expr_binary(&mut self, binary: &'ast syn::ExprBinary) {
        if !binds(&binary.left) && !binds(&binary.right) {
            for other in swapped(&binary.op) {
                let (left, right) = (self.of(binary.left.span()), self.of(binary.right.span()));
                // (`a as usize < b` needs brackets; the left side of an assignment cannot have them.)
                let mutated = match assigns(&binary.op) {
                    true => format!("{left} {other} ({right})"),
                    false => format!("({left}) {other} ({right})"),
                };
                self.add(binary.span(), Form::Expression, mutated);
            }
        }
        visit::visit_expr_binary(self, binary);
    }

    fn visit_expr_unary(&mut self, unary: &'ast syn::ExprUnary) {
        if matches!(unary.op, UnOp::Neg(_) | UnOp::Not(_)) {
            let inner = self.of(unary.expr.span()).to_owned();
            self.add(unary.span(), Form::Expression, inner);
        }
        visit::visit_expr_unary(self, unary);
    }

    fn visit_expr_lit(&mut self, literal: &'ast syn::ExprLit) {
        self.number(literal);
    }

    fn visit_expr_if(&mut self, branch: &'ast syn::ExprIf) {
        self.condition(&branch.cond, &["true", "false"]);
        visit::visit_expr_if(self, branch);
    }

    fn visit_expr_while(&mut self, repeated: &'ast syn::ExprWhile) {
        self.condition(&repeated.cond, &["false"]);
        visit::visit_expr_while(self, repeated);
    }

    fn visit_arm(&mut self, arm: &'ast syn::Arm) {
        if let Some((_, guard)) = &arm.guard {
            self.condition(guard, &["true", "false"]);
        }
        visit::visit_arm(self, arm);
    }

    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        let name = call.method.to_string();
        for [one, other] in METHODS {
            let mutated = match name.as_str() {
                same if same == one => other,
                same if same == other => one,
                _ => continue,
            };
            let (range, method) = (call.span().byte_range(), call.method.span().byte_range());
            let text =
                format!("{}{mutated}{}", &self.text[range.start..method.start], &self.text[method.end..range.end]);
            self.add(call.span(), Form::Expression, text);
        }
        visit::visit_expr_method_call(self, call);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(code: &str) -> Vec<[String; 2]> {
        let text = format!("fn f() {{ {code} }}");
        let all = mutants("src/f.rs", &text).expect("code");
        all.iter().map(|mutant| mutant.shown(&text).into()).collect()
    }

    #[test]
    fn operators_become_their_neighbors() {
        let pairs = |pairs: &[[&str; 2]]| pairs.iter().map(|pair| pair.map(String::from)).collect::<Vec<_>>();
        assert_eq!(found("a + b"), pairs(&[["a + b", "(a) - (b)"]]));
        assert_eq!(found("a < b"), pairs(&[["a < b", "(a) <= (b)"], ["a < b", "(a) >= (b)"]]));
        assert_eq!(found("x += y;"), pairs(&[["x += y", "x -= (y)"], ["x += y;", "(dropped)"]]));
        assert_eq!(found("let c = 0.5;"), pairs(&[["0.5", "1.5"]]));
        assert_eq!(found("if fine {}"), pairs(&[["fine", "true"], ["fine", "false"]]));
        assert_eq!(found("let x = a.min(-b);"), pairs(&[["a.min(-b)", "a.max(-b)"], ["-b", "b"]]));
    }

    #[test]
    fn what_binds_or_is_constant_or_an_error_stays() {
        for code in [
            "if let Some(x) = y && z {}",
            "const C: f64 = 1.0 + 2.0;",
            "let x: [f64; 3] = y;",
            "match x { 0..3 => {} _ => {} }",
            "assert!(a + b < c);",
            "return Err(Error::Step { h: 2.0 * h });",
        ] {
            assert_eq!(found(code), Vec::<[String; 2]>::new(), "{code}");
        }
        let text = "#[cfg(test)] mod tests { fn f() { a + b } } #[cfg(any(test, doctest))] mod g { fn f() { !a } }";
        assert_eq!(mutants("src/f.rs", text), Ok(Vec::new()));
    }

    #[test]
    fn the_same_change_twice_in_a_line_has_two_names() {
        let keys: Vec<String> =
            mutants("src/f.rs", "fn f() { g(1, 1) }").expect("code").into_iter().map(|mutant| mutant.key).collect();
        assert_eq!(keys, ["src/f.rs | fn f() { g(1, 1) } | 1 | 2", "src/f.rs | fn f() { g(1, 1) } | 1 | 2 | 2"]);
    }
}
