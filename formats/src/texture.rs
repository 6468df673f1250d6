//! MTL material libraries and their textures (PNG, JPEG).

use super::{FormatError, beside};
use image::{ImageReader, Limits, RgbImage};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Widest and highest texture accepted [pixel].
const SIDE_LIMIT: u32 = 16384;
/// Most memory a texture may take [byte].
const MEMORY_LIMIT: u64 = 1 << 30;
/// Most pixels a byte of file can hold: deflate packs 1032 bytes into one, of eight 1-bit pixels each.
const PIXELS_PER_BYTE: u64 = 1032 * 8;

/// A material's diffuse colour.
pub(super) enum Paint {
    /// The same everywhere.
    Plain([f64; 3]),
    /// From a texture.
    Texture(RgbImage),
}

#[derive(Default)]
struct Material {
    diffuse: Option<[f64; 3]>,
    texture: Option<String>,
    ambient: Option<String>,
}

impl Material {
    fn picture(&self) -> Option<&String> {
        self.texture.as_ref().or(self.ambient.as_ref())
    }
}

/// A material library as parsed; unknown lines are passed over.
#[derive(Default)]
pub(super) struct Library {
    materials: Vec<(String, Material)>,
}

impl Library {
    pub(super) fn parse(bytes: &[u8]) -> Library {
        let mut library = Library::default();
        for line in bytes.split(|&b| b == b'\n') {
            let line = String::from_utf8_lossy(line);
            let line = line.trim();
            let Some((keyword, rest)) = line.split_once(char::is_whitespace) else { continue };
            if keyword == "newmtl" {
                library.materials.push((rest.trim().to_string(), Material::default()));
                continue;
            }
            let Some((_, material)) = library.materials.last_mut() else { continue };
            match keyword.to_ascii_lowercase().as_str() {
                "kd" => {
                    let values: Vec<f64> = rest.split_whitespace().filter_map(|w| w.parse().ok()).collect();
                    if let [r, g, b] = *values.as_slice() {
                        material.diffuse = Some([r, g, b].map(|x| 255.0 * x.clamp(0.0, 1.0)));
                    }
                }
                "map_kd" => material.texture = Some(without_options(rest)),
                // some programs write the colour as the ambient one alone
                "map_ka" => material.ambient = Some(without_options(rest)),
                _ => {}
            }
        }
        library
    }

    /// Textures named, as written.
    pub(super) fn textures(&self) -> Vec<String> {
        self.materials.iter().filter_map(|(_, m)| m.picture().cloned()).collect()
    }

    /// The paints of the materials that are `used`. A texture that is not among `files` gives none: the colour of a scan
    /// is optional, and who loads the files tells its owner what is missing.
    pub(super) fn paints(
        self,
        path: &str,
        files: &BTreeMap<String, Vec<u8>>,
        used: impl Fn(&str) -> bool,
    ) -> Result<Vec<(String, Paint)>, FormatError> {
        let mut paints = Vec::new();
        for (name, material) in self.materials.into_iter().filter(|(name, _)| used(name)) {
            match material.picture().cloned() {
                Some(texture) => {
                    let path = beside(path, &texture).unwrap_or(texture);
                    if let Some(bytes) = files.get(&path) {
                        paints.push((name, Paint::Texture(decode(&path, bytes)?)));
                    }
                }
                None => paints.extend(material.diffuse.map(|colour| (name, Paint::Plain(colour)))),
            }
        }
        Ok(paints)
    }
}

/// A texture by its path among `files`; `None` where it is not there.
pub(super) fn texture(path: &str, files: &BTreeMap<String, Vec<u8>>) -> Result<Option<Paint>, FormatError> {
    files.get(path).map(|bytes| decode(path, bytes).map(Paint::Texture)).transpose()
}

/// The file name of a `map_Kd` line: what follows its options (`-s 1 1 1`, `-clamp on`, ...); it may hold spaces.
fn without_options(rest: &str) -> String {
    let mut rest = rest.trim();
    while rest.starts_with('-') {
        let Some((_, mut tail)) = rest.split_once(char::is_whitespace) else { break };
        while let Some((word, after)) = tail.trim_start().split_once(char::is_whitespace) {
            if word.parse::<f64>().is_err() && word != "on" && word != "off" {
                break;
            }
            tail = after;
        }
        rest = tail.trim_start();
    }
    rest.trim().to_string()
}

fn decode(path: &str, bytes: &[u8]) -> Result<RgbImage, FormatError> {
    let refuse = |what: String| FormatError(format!("texture {path}: {what}"));
    let open = || ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let (width, height) =
        open().map_err(|e| refuse(e.to_string()))?.into_dimensions().map_err(|e| refuse(e.to_string()))?;
    if u64::from(width) * u64::from(height) > PIXELS_PER_BYTE * bytes.len() as u64 {
        return Err(refuse(format!("{width} x {height} pixels cannot come from {} bytes", bytes.len())));
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_LIMIT);
    limits.max_image_height = Some(SIDE_LIMIT);
    limits.max_alloc = Some(MEMORY_LIMIT);
    let mut reader = open().map_err(|e| refuse(e.to_string()))?;
    reader.limits(limits);
    let image = reader.decode().map_err(|e| refuse(e.to_string()))?.into_rgb8();
    if image.width() == 0 || image.height() == 0 {
        return Err(refuse("it has no pixels".into()));
    }
    Ok(image)
}

impl Paint {
    /// The colour at texture coordinates (origin bottom left, repeating), linear between pixel centres; `None` for a
    /// texture where the corner has no coordinates.
    pub(super) fn at(&self, uv: Option<[f64; 2]>) -> Option<[f64; 3]> {
        match self {
            Paint::Plain(colour) => Some(*colour),
            Paint::Texture(image) => uv.filter(|c| c.iter().all(|x| x.is_finite())).map(|c| sample(image, c)),
        }
    }

    /// How many texels lie between two texture coordinates; none for a plain colour.
    pub(super) fn texels(&self, [u, v]: [f64; 2], [s, t]: [f64; 2]) -> f64 {
        match self {
            Paint::Plain(_) => 0.0,
            Paint::Texture(image) => ((u - s) * f64::from(image.width())).hypot((v - t) * f64::from(image.height())),
        }
    }
}

fn sample(image: &RgbImage, [u, v]: [f64; 2]) -> [f64; 3] {
    // Exactly 1 is the far edge, not the near one again.
    let wrap = |x: f64| if (0.0..=1.0).contains(&x) { x } else { x.rem_euclid(1.0) };
    let place = |x: f64, size: u32| {
        let x = (wrap(x) * f64::from(size) - 0.5).clamp(0.0, f64::from(size - 1));
        (x.floor() as u32, (x.floor() as u32 + 1).min(size - 1), x.fract())
    };
    let (left, right, fx) = place(u, image.width());
    let (top, bottom, fy) = place(1.0 - v, image.height());
    let pixel = |x, y, k: usize| f64::from(image.get_pixel(x, y).0[k]);
    std::array::from_fn(|k| {
        (1.0 - fy) * ((1.0 - fx) * pixel(left, top, k) + fx * pixel(right, top, k))
            + fy * ((1.0 - fx) * pixel(left, bottom, k) + fx * pixel(right, bottom, k))
    })
}
