//! Points picked in MeshLab (.pp). The file says neither frame nor unit: they are those of the surface that was open.

use super::slicer::Placed;
use crate::StageError;
use meshes::Point;
use sim::xml::Tags;

/// The points of a file of MeshLab's; `None` for another kind of file.
pub(super) fn read(path: &str, bytes: &[u8]) -> Option<Result<Vec<Placed>, StageError>> {
    let (text, _) = sim::text::decoded(bytes);
    let is_meshlab = text.contains("<PickedPoints") || path.to_ascii_lowercase().ends_with(".pp");
    is_meshlab.then(|| points(&text).map_err(|what| StageError::file(path, what)))
}

fn points(text: &str) -> Result<Vec<Placed>, String> {
    let mut points = Vec::new();
    let mut whole = false;
    for tag in Tags::of(text) {
        whole |= tag.name == "PickedPoints" && tag.closing;
        // a point that was announced and not picked is not active
        if tag.name != "point" || tag.closing || tag.attribute("active").is_some_and(|a| a == "0") {
            continue;
        }
        let place = format!("point {}", points.len() + 1);
        let number = |axis: &str| {
            let found = tag.attribute(axis).unwrap_or_default();
            let value = found.trim().parse::<f64>().ok().filter(|x| x.is_finite());
            value.ok_or_else(|| format!("{place}: {axis} is `{found}`; expected a number in mm"))
        };
        let point = Point::new(number("x")?, number("y")?, number("z")?);
        points.push(Placed { name: tag.attribute("name").unwrap_or_default(), point, place });
    }
    match whole {
        true => Ok(points),
        false => Err("no end of MeshLab's picked points (</PickedPoints>); the file is cut short".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_meshlab_are_read_or_named() {
        let text = "<!DOCTYPE PickedPoints>\n<PickedPoints>\n <DocumentData>\n  <DateTime time=\"1\"/>\n </DocumentData>\n <point x=\"1.5\" y=\"-2\" z=\"3e1\" name=\"ACL &amp; a\" active=\"1\"/>\n <point x=\"0\" y=\"0\" z=\"0\" name=\"b\" active=\"0\"/>\n</PickedPoints>\n";
        let found = read("a.pp", text.as_bytes()).unwrap().unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].name.as_str(), found[0].point), ("ACL & a", Point::new(1.5, -2.0, 30.0)));
        let told = |text: &str| read("a.pp", text.as_bytes()).unwrap().err().unwrap().to_string();
        assert!(told(&text.replace("1.5", "x")).contains("point 1: x"));
        assert!(told(&text[..200]).contains("cut short"));
        assert!(read("a.csv", b"name,frame,x_mm,y_mm,z_mm\n").is_none());
    }
}
