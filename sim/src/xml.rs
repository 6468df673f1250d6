//! The tags of XML, as far as tables and lists of points need them. What is no tag is passed over; nothing is ever refused here.

use std::borrow::Cow;

/// A tag with the text up to the next one.
#[derive(Clone, Copy, Debug)]
pub struct Tag<'a> {
    /// Its name without the namespace.
    pub name: &'a str,
    attributes: &'a str,
    /// Whether it closes what an earlier one opened.
    pub closing: bool,
    /// Whether it closes itself.
    pub empty: bool,
    /// The text that follows it, with its entities.
    pub text: &'a str,
}

impl Tag<'_> {
    /// The value of an attribute, whatever its namespace.
    pub fn attribute(&self, name: &str) -> Option<String> {
        let mut rest = self.attributes;
        loop {
            let (key, after) = rest.split_once('=')?;
            let after = after.trim_start();
            let quote = after.chars().next().filter(|c| ['"', '\''].contains(c))?;
            let (value, left) = after[1..].split_once(quote)?;
            if key.trim().rsplit(':').next() == Some(name) {
                return Some(plain(value));
            }
            rest = left;
        }
    }
}

/// The tags of a text, in order; what is no tag is passed over.
#[derive(Clone, Debug)]
pub struct Tags<'a> {
    rest: &'a str,
}

impl<'a> Tags<'a> {
    /// Of a text.
    pub fn of(xml: &'a str) -> Tags<'a> {
        Tags { rest: xml }
    }
}

impl<'a> Iterator for Tags<'a> {
    type Item = Tag<'a>;

    fn next(&mut self) -> Option<Tag<'a>> {
        let open = self.rest.find('<')? + 1;
        let inner = &self.rest[open..];
        let close = inner.find('>')?;
        let (body, after) = (&inner[..close], &inner[close + 1..]);
        let text = &after[..after.find('<').unwrap_or(after.len())];
        self.rest = after;
        let (closing, body) = body.strip_prefix('/').map_or((false, body), |b| (true, b));
        let (empty, body) = body.strip_suffix('/').map_or((false, body), |b| (true, b));
        let (name, attributes) = body.split_once(char::is_whitespace).unwrap_or((body, ""));
        Some(Tag { name: name.rsplit(':').next().unwrap_or(name), attributes, closing, empty, text })
    }
}

/// Text with its entities resolved.
pub fn plain(text: &str) -> String {
    if !text.contains('&') {
        return text.to_owned();
    }
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('&') {
        out += &rest[..at];
        let tail = &rest[at + 1..];
        let found = tail.split_once(';').and_then(|(name, left)| Some((entity(name)?, left)));
        match found {
            Some((c, left)) => {
                out += &c;
                rest = left;
            }
            None => {
                out.push('&');
                rest = tail;
            }
        }
    }
    out + rest
}

fn entity(name: &str) -> Option<Cow<'static, str>> {
    let number = |digits: &str, base| u32::from_str_radix(digits, base).ok().and_then(char::from_u32);
    Some(match name {
        "amp" => "&".into(),
        "lt" => "<".into(),
        "gt" => ">".into(),
        "quot" => "\"".into(),
        "apos" => "'".into(),
        _ => {
            let digits = name.strip_prefix('#')?;
            let c = digits.strip_prefix('x').map_or_else(|| number(digits, 10), |hex| number(hex, 16))?;
            c.to_string().into()
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_attributes_and_entities_are_read() {
        let text = "<?xml version=\"1.0\"?><x:row r='1' x:s=\"a &amp; b\"><v>1 &lt; &#x32;</v><c/></x:row> <broken";
        let tags: Vec<Tag> = Tags::of(text).collect();
        let names: Vec<(&str, bool, bool)> = tags.iter().map(|t| (t.name, t.closing, t.empty)).collect();
        let wanted = [
            ("?xml", false, false),
            ("row", false, false),
            ("v", false, false),
            ("v", true, false),
            ("c", false, true),
            ("row", true, false),
        ];
        assert_eq!(names, wanted);
        assert_eq!(tags[1].attribute("s").as_deref(), Some("a & b"));
        assert_eq!(tags[1].attribute("r").as_deref(), Some("1"));
        assert_eq!(tags[1].attribute("t"), None);
        assert_eq!(plain(tags[2].text), "1 < 2");
        assert_eq!(plain("a & b; &nothing; &#xFFFFFFFF;"), "a & b; &nothing; &#xFFFFFFFF;");
    }
}
