//! The still pictures of the report, for print and where 3D is not to be had.

use image::ImageEncoder;
use meshes::Vector;
use meshes::render::{Painted, View, render};

/// The colour of bone.
pub(crate) const BONE: [u8; 3] = [225, 213, 190];
const SIZE: (usize, usize) = (420, 420);

/// A picture with its words.
pub(crate) struct Picture {
    /// PNG bytes.
    pub(crate) png: Vec<u8>,
    /// Pixels across.
    pub(crate) width: usize,
    /// What it shows.
    pub(crate) caption: String,
}

/// Surfaces as they are seen from one side.
pub(crate) fn picture(painted: &[Painted], towards_eye: Vector, up: Vector, caption: String) -> Picture {
    let seen = render(painted, &View { towards_eye, up }, SIZE.0, SIZE.1);
    // what nothing is painted on is clear, so that the page's own ground shows
    let clear = |p: &[u8]| [p[0], p[1], p[2], if p == [255, 255, 255] { 0 } else { 255 }];
    let pixels: Vec<u8> = seen.pixels.chunks_exact(3).flat_map(clear).collect();
    let mut png = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut png);
    // Writing to memory does not fail; an empty picture would show in the page.
    let _ = encoder.write_image(&pixels, seen.width as u32, seen.height as u32, image::ExtendedColorType::Rgba8);
    Picture { png, width: SIZE.0, caption }
}
