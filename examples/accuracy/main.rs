//! Writes docs/accuracy.md: what the geometry stages reach on every knee with truth that is there, and on variants of them.
//!
//! `cargo run --release --example accuracy` writes the page; with names of sections (register, cartilage, methods, frames,
//! marks, meshes) those are printed instead. The shared specimens are taken where they are, the phantoms always.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example says what it found")]

mod built;
mod cartilage;
mod frames;
mod knees;
#[path = "../../tests/common/lines.rs"]
mod lines;
mod marks;
mod methods;
mod page;
mod register;
#[path = "../../stages/tests/common/registration.rs"]
#[allow(clippy::unwrap_used, reason = "shared with tests")]
mod registration;

use page::Section;

const HEAD: &str = "# Accuracy of the geometry stages\n\n\
Written by `cargo run --release --example accuracy` from the shared specimens, femur z013 and the phantoms; not by hand. Each line is a figure over its cases: the limit it should keep, \
the median, the worst, and every case beyond the limit.\n";

fn main() -> Result<(), String> {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let asked = |name: &str| wanted.is_empty() || wanted.iter().any(|w| w == name);
    let knees = knees::all()?;
    eprintln!("{} knees", knees.len());
    let mut sections: Vec<Section> = Vec::new();
    if asked("register") {
        sections.extend(register::sections(&knees));
    }
    let mut built = Vec::new();
    if ["cartilage", "frames", "marks", "meshes"].iter().any(|s| asked(s)) {
        for knee in &knees {
            built.push((knee, built::build(knee).map_err(|e| format!("{}: {e}", knee.name))?));
            eprintln!("{} built", knee.name);
        }
    }
    if asked("cartilage") {
        sections.push(cartilage::section(&built));
    }
    if asked("methods") {
        sections.push(methods::section(&knees)?);
    }
    if asked("frames") {
        sections.push(frames::section(&built)?);
    }
    if asked("marks") {
        sections.push(marks::section(&built));
    }
    if asked("meshes") {
        sections.push(built::literature(&built));
        sections.extend(built::meshes(&built));
    }
    let tallies = sections.iter().map(Section::tally);
    let (beyond, all) = tallies.fold((0, 0), |(b, a), t| (b + t.0, a + t.1));
    let mut text = format!("{HEAD}\nOf {all} figures {beyond} have a case beyond their limit.\n");
    sections.iter().for_each(|s| text += &format!("\n{}", s.text()));
    if wanted.is_empty() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/accuracy.md");
        return genu::store::write(&path, text.as_bytes()).map_err(|e| e.to_string());
    }
    println!("{text}");
    Ok(())
}
