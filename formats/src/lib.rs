//! File formats of surfaces, meshes and volumes: STL, PLY, OBJ (with MTL and textures), VTK, VTU; NIfTI, NRRD, MetaImage, MGH, DICOM.
//!
//! No reader panics, hangs, or allocates by what a header claims: counts are held against the bytes that are there.

mod detail;
pub mod dicom;
pub mod kind;
mod metaimage;
mod mgh;
pub mod nifti;
mod nrrd;
pub mod obj;
pub mod picture;
pub mod ply;
mod raw;
pub mod stl;
mod texture;
pub mod vtk;
pub mod vtu;

use meshes::surface::ColouredMesh;
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// What a codec refuses, in words for the person who owns the file.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[error("{0}")]
pub struct FormatError(pub String);

/// A surface file's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceFormat {
    /// STL, binary or ASCII.
    Stl,
    /// PLY, ASCII or binary of either byte order.
    Ply,
    /// Wavefront OBJ.
    Obj,
    /// VTK, legacy or XML.
    Vtk,
}

/// Reads a surface file, STL, PLY, OBJ or VTK, told apart by content and, where that does not decide, by the ending of `name`.
///
/// `name` is the file's path relative to the specimen; `files` holds the specimen's files by such paths and serves the
/// material libraries and textures an OBJ names ([`companions`]). Positions as in the file, but where 3D Slicer
/// has written that they are in RAS: those are turned to LPS. Errors name the line or element.
pub fn read_surface(name: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>) -> Result<ColouredMesh, FormatError> {
    read_surface_told(name, bytes, files).map(|(read, _)| read)
}

/// As [`read_surface`], with what is odd about the file but not fatal: of its colours and its numbers.
pub fn read_surface_told(
    name: &str,
    bytes: &[u8],
    files: &BTreeMap<String, Vec<u8>>,
) -> Result<(ColouredMesh, Vec<Notice>), FormatError> {
    let bare = |mesh| (ColouredMesh { mesh, colours: Vec::new() }, Vec::new());
    let (mut read, mut notes) = match surface_format(name, bytes)? {
        SurfaceFormat::Stl => bare(stl::read(bytes)?),
        SurfaceFormat::Ply => ply::read_told(name, bytes, files)?,
        SurfaceFormat::Obj => obj::read_told(name, bytes, files)?,
        SurfaceFormat::Vtk => bare(vtk::read(bytes)?),
    };
    if says_ras(bytes) {
        read.mesh.vertices.iter_mut().for_each(|p| *p = Point::new(-p.x, -p.y, p.z));
    }
    if let Some(first) = read.colours.first().filter(|c| read.colours.iter().all(|d| d == *c)) {
        notes.push(
            Kind::OneColour
                .notice(format!("all its vertices have one colour ({first:?}): no outline can be found on it")),
        );
    }
    notes.extend(coarse(&read.mesh.vertices).or_else(|| rounded(&read.mesh.vertices)));
    Ok((read, notes))
}

/// Steps of the coordinates from which on they are told [mm]: a hundredth of the scanners' noise would not be, a fifth is. Ours.
const COARSE_MM: f64 = 0.02;

/// Single precision far from the origin: how far apart its numbers lie.
fn coarse(vertices: &[Point]) -> Option<Notice> {
    let farthest = vertices.iter().flat_map(|p| p.coords.iter().copied()).fold(0.0f64, |a, x| a.max(x.abs()));
    let step = f64::from(f32::EPSILON) * farthest.log2().floor().exp2();
    let single = || vertices.iter().flat_map(|p| p.coords.iter().copied()).all(|x| f64::from(x as f32) == x);
    (step.is_finite() && step > COARSE_MM && single()).then(|| {
        Kind::CoarseNumbers.notice(format!(
            "its numbers are of single precision and lie up to {farthest:.0} from the origin, so they come in steps of {step:.2} mm: move the surface near the origin before it is exported"
        ))
    })
}

/// Steps of rounded coordinates that are told, the coarsest first [mm]: cartilage is 2 mm thick, and half a step is lost. Ours.
const ROUNDED_MM: [f64; 2] = [1.0, 0.5];
/// Surfaces of fewer vertices may be made of round numbers, as boxes are.
const LEAST_ROUNDED: usize = 1000;

/// Coordinates that are all whole multiples of a step: written without their decimals, or taken from a grid.
fn rounded(vertices: &[Point]) -> Option<Notice> {
    let whole = |step: f64| vertices.iter().flat_map(|p| p.coords.iter()).all(|x| (x / step).fract() == 0.0);
    let step = ROUNDED_MM.into_iter().find(|step| vertices.len() >= LEAST_ROUNDED && whole(*step))?;
    Some(Kind::CoarseNumbers.notice(format!(
        "all its coordinates come in steps of {step} mm: rounded, written without decimals, or the corners of voxels? Expected hundredths of a millimetre: export it with more decimals"
    )))
}

/// What a colour's numbers run to, by the largest of them: 1, 255 or 65535.
fn full_scale(largest: f64) -> f64 {
    [1.0, 255.0].into_iter().find(|full| largest <= *full).unwrap_or(65535.0)
}

/// Bytes in which a header says its frame: an STL's 80, a PLY's or VTK's comment.
const SPACE_WITHIN: usize = 500;

/// Whether a surface file says itself that it is in RAS or LPS, as 3D Slicer writes it.
pub fn says_space(bytes: &[u8]) -> bool {
    says_ras(bytes) || bytes[..bytes.len().min(SPACE_WITHIN)].windows(9).any(|w| w == b"SPACE=LPS")
}

/// Whether 3D Slicer says in the file's header that it is in RAS; it writes `SPACE=RAS` or `SPACE=LPS`.
fn says_ras(bytes: &[u8]) -> bool {
    bytes[..bytes.len().min(SPACE_WITHIN)].windows(9).any(|w| w == b"SPACE=RAS")
}

/// The kind of a surface file, by content first, then by the ending of its name.
pub fn surface_format(name: &str, bytes: &[u8]) -> Result<SurfaceFormat, FormatError> {
    let body = stl::text_start(bytes);
    let refuse = |what: &str| Err(FormatError(format!("{what}; expected a surface as STL, PLY, OBJ or VTK")));
    let starts = |word: &[u8]| body.len() >= word.len() && body[..word.len()].eq_ignore_ascii_case(word);
    let extension = name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase()).unwrap_or_default();
    if bytes.is_empty() {
        return refuse("the file is empty");
    } else if starts(b"version https://git-lfs") {
        return refuse("the file is a Git LFS pointer, not the data: fetch it with `git lfs pull`");
    } else if starts(b"<!doctype") || starts(b"<html") {
        return refuse("the file is a web page, perhaps an error page saved in place of the download");
    } else if starts(b"PK\x03\x04") {
        return refuse("the file is a zip archive (or 3MF): unpack or export it");
    } else if starts(b"\x1f\x8b") {
        return refuse("the file is packed (gzip): unpack it");
    } else if starts(b"glTF") {
        return refuse("the file is glTF: export it");
    } else if [&b"OFF"[..], b"COFF", b"NOFF"].iter().any(|word| starts(word)) {
        return refuse("the file is OFF: open it in MeshLab and export it");
    } else if starts(b"<x3d") || starts(b"#VRML") || starts(b"#Inventor") {
        return refuse("the file is X3D, VRML or Inventor: open it in MeshLab and export it");
    } else if starts(b"ISO-10303-21") {
        return refuse("the file is STEP, a solid of a CAD program: export its surface as a mesh");
    } else if (starts(b"*HEADING") || starts(b"*NODE") || starts(b"**")) && !stl::looks_binary(bytes) {
        return refuse(
            "the file is an Abaqus deck: `build-model import-abaqus` reads a whole knee; export the bone alone as a mesh",
        );
    } else if starts(b"$MeshFormat") || starts(b"<?xml") && body.windows(11).take(500).any(|w| w == b"<febio_spec") {
        return refuse("the file is a mesh of Gmsh or FEBio: export its surface");
    }
    if starts(b"ply\n") || starts(b"ply\r") {
        Ok(SurfaceFormat::Ply)
    } else if vtk::looks_legacy(body) || vtk::looks_xml(body) {
        Ok(SurfaceFormat::Vtk)
    } else if stl::looks_binary(bytes) || stl::looks_ascii(bytes) {
        Ok(SurfaceFormat::Stl)
    } else {
        match extension.as_str() {
            "obj" => Ok(SurfaceFormat::Obj),
            "stl" => Ok(SurfaceFormat::Stl),
            "ply" => refuse("the file ends in .ply but does not begin with `ply`"),
            _ => refuse(&format!("the ending `.{extension}` and the content are of no known kind")),
        }
    }
}

/// Paths of the files that the file `name` names and needs: an OBJ's material libraries, a material library's and a PLY's textures,
/// a detached header's voxels.
/// Relative to the specimen, in order of appearance, each once; a path that would lead out of the specimen is left out.
pub fn companions(name: &str, bytes: &[u8]) -> Vec<String> {
    let lower = name.to_ascii_lowercase();
    let named = if lower.ends_with(".obj") {
        obj::material_libraries(bytes)
    } else if lower.ends_with(".mtl") {
        texture::Library::parse(bytes).textures()
    } else if lower.ends_with(".ply") {
        ply::textures(bytes)
    } else {
        picture::data_file(bytes).into_iter().collect()
    };
    let mut paths: Vec<String> = Vec::new();
    for path in named.iter().filter_map(|n| beside(name, n)) {
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    paths
}

/// The path of `other`, as written inside the file `name`, relative to the specimen; of an absolute path, which is another machine's, the
/// file of its name beside. `None` if outside.
pub(crate) fn beside(name: &str, other: &str) -> Option<String> {
    let mut other = other.trim_matches('"').replace('\\', "/");
    if other.starts_with('/') || other.as_bytes().get(1) == Some(&b':') {
        other = other.rsplit('/').next().filter(|name| !name.is_empty())?.to_owned();
    }
    let mut parts: Vec<&str> = name.split('/').collect();
    parts.pop();
    for part in other.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

/// More corners than any real exporter writes; a polygon of more is refused, so that its cutting cannot take long.
const POLYGON_LIMIT: usize = 256;

/// Cuts a polygon (indices of `vertices`) into triangles that do not overlap, by clipping ears in the plane of its area
/// vector; a convex one falls into a fan.
pub(crate) fn cut_polygon(
    vertices: &[Point],
    polygon: &[u32],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), FormatError> {
    match *polygon {
        [] | [_] | [_, _] => return Err(FormatError(format!("a face with {} corners", polygon.len()))),
        [a, b, c] => {
            triangles.push([a, b, c]);
            return Ok(());
        }
        _ if polygon.len() > POLYGON_LIMIT => {
            return Err(FormatError(format!("a face with {} corners, more than {POLYGON_LIMIT}", polygon.len())));
        }
        _ => {}
    }
    let at = |v: u32| vertices[v as usize];
    let turn = |a: u32, b: u32, c: u32| (at(b) - at(a)).cross(&(at(c) - at(a)));
    let normal: Vector = (1..polygon.len() - 1).map(|k| turn(polygon[0], polygon[k], polygon[k + 1])).sum();
    let inside = |a, b, c, p| [(a, b), (b, c), (c, a)].iter().all(|&(s, e)| turn(s, e, p).dot(&normal) > 0.0);
    let mut left = polygon.to_vec();
    while left.len() > 3 {
        let n = left.len();
        let corner = |k: usize| (left[(k + n - 1) % n], left[k % n], left[(k + 1) % n]);
        let ear = (1..=n).find(|&k| {
            let (a, b, c) = corner(k);
            turn(a, b, c).dot(&normal) > 0.0 && !left.iter().any(|&p| p != a && p != b && p != c && inside(a, b, c, p))
        });
        let k = ear.unwrap_or(1);
        let (a, b, c) = corner(k);
        triangles.push([a, b, c]);
        left.remove(k % n);
    }
    triangles.push([left[0], left[1], left[2]]);
    Ok(())
}

/// A coordinate beyond this is a damaged number [mm]: maps of a country in micrometres reach 1e13. Ours.
const FARTHEST: f64 = 1e14;

/// The first vertex that is not a finite number, or lies nowhere, as an error.
pub(crate) fn refuse_not_finite(vertices: &[Point]) -> Result<(), FormatError> {
    match vertices.iter().position(|p| !p.coords.iter().all(|x| x.is_finite())) {
        Some(v) => Err(FormatError(format!(
            "vertex {} has a coordinate that is not a finite number ({} {} {}); expected mm: remove unmeasured points before export",
            v + 1,
            vertices[v].x,
            vertices[v].y,
            vertices[v].z
        ))),
        None => match vertices.iter().position(|p| p.coords.amax() > FARTHEST) {
            Some(v) => Err(FormatError(format!(
                "vertex {} has a coordinate of size {:e}: a damaged number; export the surface again, or copy the file again",
                v + 1,
                vertices[v].coords.amax()
            ))),
            None => Ok(()),
        },
    }
}

#[cfg(test)]
mod tests;
