//! The arithmetic of *PARAMETER: numbers, names, + - * / **, parentheses and a few functions.

use std::collections::BTreeMap;

/// Parentheses, signs and powers nest no deeper than this.
const DEEPEST: usize = 64;

/// Evaluates `text` with the values in `names` (exact match first, then without regard to case).
///
/// # Errors
/// In words: what is not understood, an unknown name, a value that is not finite.
pub fn evaluate(text: &str, names: &BTreeMap<String, f64>) -> Result<f64, String> {
    if text.len() > 4096 {
        return Err("expression longer than 4096 characters".into());
    }
    let mut parser = Parser { rest: text.trim(), names, depth: 0 };
    let value = parser.sum()?;
    if !parser.rest.is_empty() {
        return Err(format!("\"{}\" not understood in \"{}\"", parser.rest, text.trim()));
    }
    if value.is_finite() { Ok(value) } else { Err(format!("\"{}\" is not finite", text.trim())) }
}

/// Whether a cell is a number with an exponent without its letter, 1.5+2 for 150, as Nastran writes it: Abaqus wants E or D there, and a sum is none of its numbers.
pub(crate) fn lacks_its_letter(text: &str) -> bool {
    let digits = |t: &str| !t.is_empty() && t.chars().all(|c| c.is_ascii_digit());
    let Some((number, exponent)) = text.trim().rsplit_once(['+', '-']) else { return false };
    let Some((whole, part)) = number.trim_start_matches(['+', '-']).split_once('.') else { return false };
    digits(exponent) && (digits(whole) || digits(part)) && [whole, part].iter().all(|t| t.is_empty() || digits(t))
}

/// A number as decks write it: Fortran exponents allowed, infinities not.
pub fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    if !text.chars().all(|c| c.is_ascii_digit() || "+-.eEdD".contains(c)) {
        return None;
    }
    text.replace(['d', 'D'], "e").parse::<f64>().ok().filter(|v| v.is_finite())
}

struct Parser<'a> {
    rest: &'a str,
    names: &'a BTreeMap<String, f64>,
    depth: usize,
}

impl Parser<'_> {
    fn eat(&mut self, token: &str) -> bool {
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest.trim_start();
                true
            }
            None => false,
        }
    }

    fn sum(&mut self) -> Result<f64, String> {
        let mut value = self.product()?;
        loop {
            if self.eat("+") {
                value += self.product()?;
            } else if self.eat("-") {
                value -= self.product()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn product(&mut self) -> Result<f64, String> {
        let mut value = self.signed()?;
        loop {
            if !self.rest.starts_with("**") && self.eat("*") {
                value *= self.signed()?;
            } else if self.eat("/") {
                value /= self.signed()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn signed(&mut self) -> Result<f64, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err("expression nested too deeply".into());
        }
        let value = if self.eat("-") {
            -self.signed()?
        } else if self.eat("+") {
            self.signed()?
        } else {
            let base = self.atom()?;
            if self.eat("**") { base.powf(self.signed()?) } else { base }
        };
        self.depth -= 1;
        Ok(value)
    }

    fn atom(&mut self) -> Result<f64, String> {
        if self.eat("(") {
            let value = self.sum()?;
            return if self.eat(")") { Ok(value) } else { Err(format!("\")\" expected before \"{}\"", self.rest)) };
        }
        let length = literal_length(self.rest);
        if length > 0 {
            let (text, rest) = self.rest.split_at(length);
            self.rest = rest.trim_start();
            return number(text).ok_or_else(|| format!("\"{text}\" is not a number"));
        }
        let length = self.rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(length);
        self.rest = rest.trim_start();
        if name.is_empty() {
            return Err(format!("a number or a name expected before \"{}\"", self.rest));
        }
        if self.eat("(") {
            let value = self.sum()?;
            if !self.eat(")") {
                return Err(format!("\")\" expected before \"{}\"", self.rest));
            }
            return function(name, value);
        }
        lookup(name, self.names).ok_or_else(|| format!("parameter \"{name}\" is not defined above"))
    }
}

/// The value of a parameter: exact match first, then without regard to case.
pub fn lookup(name: &str, names: &BTreeMap<String, f64>) -> Option<f64> {
    names.get(name).copied().or_else(|| names.iter().find(|(k, _)| k.eq_ignore_ascii_case(name)).map(|(_, v)| *v))
}

fn function(name: &str, x: f64) -> Result<f64, String> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "sqrt" => x.sqrt(),
        "abs" => x.abs(),
        "sin" => x.sin(),
        "cos" => x.cos(),
        "tan" => x.tan(),
        "exp" => x.exp(),
        "log" => x.ln(),
        _ => return Err(format!("function \"{name}\" is not known; expected sqrt, abs, sin, cos, tan, exp or log")),
    })
}

/// Length of the number at the start of `text`; 0 where none stands.
fn literal_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |mut i: usize| {
        while bytes.get(i).is_some_and(u8::is_ascii_digit) {
            i += 1;
        }
        i
    };
    let mut end = digits(0);
    let mut any = end > 0;
    if bytes.get(end) == Some(&b'.') {
        let after = digits(end + 1);
        any |= after > end + 1;
        end = after;
    }
    if !any {
        return 0;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E' | b'd' | b'D')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let after = digits(end + 1 + sign);
        if after > end + 1 + sign {
            return after;
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_follows_the_usual_order() {
        let names = BTreeMap::from([("L".to_owned(), 10.0), ("et".to_owned(), 0.03)]);
        for (text, value) in [
            ("1+2*3", 7.0),
            ("-2**2", -4.0),
            ("2*-3", -6.0),
            ("--20.5", 20.5),
            ("L*(1+ET*3/2)-L", 0.45),
            ("(L-4)**2/2", 18.0),
            ("1.5E1 + .5", 15.5),
            ("sqrt(4)/4/2", 0.25),
        ] {
            assert!((evaluate(text, &names).unwrap() - value).abs() < 1e-12, "{text}");
        }
        for bad in ["", "1+", "(1", "x", "1 2", "9**9**9**9", "1/0", &"(".repeat(5000), &"-".repeat(500), "inf", "nan"]
        {
            assert!(evaluate(bad, &names).is_err(), "{bad}");
        }
    }
}
