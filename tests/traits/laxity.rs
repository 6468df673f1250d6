//! Traits of laxity files: zeros, signs, units, decimal commas, separators, encodings, thousands.

use super::{Dice, Trait};
use crate::common::{text, write};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;

pub(super) const TABLE: &str = "laxity/rks.csv";

/// The table with its cells changed, by column's name and row; `None` leaves a cell.
fn cells(folder: &Path, change: impl Fn(&str, &[&str], &str) -> Option<String>) {
    let path = folder.join(TABLE);
    let table = text(&path);
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let mut out = header.join(",") + "\n";
    for line in table.lines().skip(1) {
        let row: Vec<&str> = line.split(',').collect();
        let new = row.iter().zip(&header).map(|(c, h)| change(h, &row, c).unwrap_or_else(|| (*c).to_owned()));
        out += &(new.collect::<Vec<_>>().join(",") + "\n");
    }
    write(&path, out);
}

/// One column's numbers changed.
fn column(name: &'static str, change: fn(f64) -> f64) -> Box<dyn Fn(&Path)> {
    Box::new(move |folder| {
        cells(folder, |h, _, c| (h == name && !c.is_empty()).then(|| change(c.parse().unwrap()).to_string()));
    })
}

/// One column counted from the first trial of each flexion.
fn at_each_flexion(name: &'static str) -> Box<dyn Fn(&Path)> {
    Box::new(move |folder| {
        let table = text(&folder.join(TABLE));
        let mut lines = table.lines();
        let at = lines.next().unwrap().split(',').position(|h| h == name).unwrap();
        let mut first: BTreeMap<String, f64> = BTreeMap::new();
        for line in lines {
            let row: Vec<&str> = line.split(',').collect();
            first.entry(row[2].to_owned()).or_insert_with(|| row[at].parse().unwrap());
        }
        cells(folder, |h, row, c| (h == name).then(|| (c.parse::<f64>().unwrap() - first[row[2]]).to_string()));
    })
}

/// One reading off by an amount, in the first trial whose name begins so.
fn jump(name: &'static str, trial: &'static str, by: f64) -> Box<dyn Fn(&Path)> {
    Box::new(move |folder| {
        let done = Cell::new(false);
        cells(folder, |h, row, c| {
            let here = h == name && row[0].starts_with(trial) && !done.get();
            here.then(|| {
                done.set(true);
                (c.parse::<f64>().unwrap() + by).to_string()
            })
        });
    })
}

/// The columns of loads.
const LOADS: [&str; 5] = ["load_vv_nm", "load_ie_nm", "load_ml_n", "load_ap_n", "load_si_n"];

/// The columns of poses.
const POSES: [&str; 5] = ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];

/// Columns so many rows lower than the others; the first rows get what the last ones had.
fn shifted(names: &'static [&'static str], by: usize) -> Box<dyn Fn(&Path)> {
    Box::new(move |folder| {
        let table = text(&folder.join(TABLE));
        let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
        let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|l| l.split(',').collect()).collect();
        let mut out = header.join(",") + "\n";
        for (k, row) in rows.iter().enumerate() {
            let above = &rows[(k + rows.len() - by) % rows.len()];
            let cell = |(at, name): (usize, &&str)| if names.contains(name) { above[at] } else { row[at] };
            out += &(header.iter().enumerate().map(cell).collect::<Vec<_>>().join(",") + "\n");
        }
        write(&folder.join(TABLE), out);
    })
}

/// A number as bookkeepers write it.
fn bracketed(cell: &str) -> String {
    cell.strip_prefix('-').map_or(cell.to_owned(), |digits| format!("({digits})"))
}

fn whole(change: impl Fn(String) -> Vec<u8> + 'static) -> Box<dyn Fn(&Path)> {
    Box::new(move |folder| {
        let path = folder.join(TABLE);
        write(&path, change(text(&path)));
    })
}

/// Draws a trait of a laxity file.
pub(super) fn draw(dice: &mut Dice) -> Trait {
    let of = |name: &str, words: &'static [&'static str], apply: Box<dyn Fn(&Path)>| Trait {
        name: format!("{name} of {TABLE}"),
        words,
        apply,
    };
    const TURNED: &[&str] = &["sign", "turned", "point that way", "moves against its load"];
    const UNIT: &[&str] = &["unit", "beyond"];
    match dice.below(58) {
        0 => of("flexion zeroed", &["zeroed"], {
            Box::new(|folder| {
                cells(folder, |h, row, c| {
                    (h == "fe_deg").then(|| (c.parse::<f64>().unwrap() - row[2].parse::<f64>().unwrap()).to_string())
                });
            })
        }),
        1 => of("poses zeroed at the first trial", &["zeroed", "counted from"], {
            Box::new(|folder| {
                let table = text(&folder.join(TABLE));
                let first: Vec<f64> =
                    table.lines().nth(1).unwrap().split(',').skip(8).map(|c| c.parse().unwrap_or(0.0)).collect();
                cells(folder, |h, row, c| {
                    let at = ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"].iter().position(|n| *n == h)?;
                    let _ = row;
                    Some((c.parse::<f64>().ok()? - first[at + 1]).to_string())
                });
            })
        }),
        2 => of("sign of ap_mm", TURNED, column("ap_mm", |x| -x)),
        3 => of("sign of ie_deg", TURNED, column("ie_deg", |x| -x)),
        4 => of("sign of vv_deg", TURNED, column("vv_deg", |x| -x)),
        5 => of("sign of load_ap_n", TURNED, column("load_ap_n", |x| -x)),
        6 => of("radians in ie_deg", &["rad", "unit"], column("ie_deg", f64::to_radians)),
        7 => of("metres in ap_mm", &["unit"], column("ap_mm", |x| x / 1000.0)),
        8 => of("kN in load_ap_n", &["unit"], column("load_ap_n", |x| x / 1000.0)),
        9 => of("N mm in load_ie_nm", UNIT, column("load_ie_nm", |x| x * 1000.0)),
        10 => of("radians in fe_deg", &["nominal", "rad"], column("fe_deg", f64::to_radians)),
        11 => of("decimal commas", &["comma*"], whole(|t| t.replace(',', ";").replace('.', ",").into_bytes())),
        12 => of("decimal commas among commas", &["comma*"], {
            whole(|t| {
                let mut lines = t.lines();
                let header = lines.next().unwrap().to_owned();
                let rest = lines.map(|l| l.replace('.', ",") + "\n").collect::<String>();
                (header + "\n" + &rest).into_bytes()
            })
        }),
        13 => of("UTF-16", &["UTF"], {
            whole(|t| [0xff, 0xfe].into_iter().chain(t.encode_utf16().flat_map(u16::to_le_bytes)).collect())
        }),
        14 => of("Latin-1", &["Latin"], whole(|t| [b"# 30 \xb0\n".to_vec(), t.into_bytes()].concat())),
        15 => of("thousands", &["thousand*"], {
            whole(|t| t.replace(',', "\t").replacen("\t50.000000\t", "\t1,050\t", 3).into_bytes())
        }),
        16 => of("ml_mm and ap_mm exchanged", &["exchanged"], {
            whole(|t| t.replacen("ml_mm,ap_mm", "ap_mm,ml_mm", 1).into_bytes())
        }),
        17 => of("moments in ft lbf", &["ft lbf"], {
            Box::new(|folder| {
                cells(folder, |h, _, c| {
                    let moment = h == "load_vv_nm" || h == "load_ie_nm";
                    moment.then(|| format!("{:.4}", c.parse::<f64>().unwrap() * 0.737_562_149))
                });
            })
        }),
        18 => of("0 for readings that are missing", &["not read"], {
            Box::new(|folder| {
                cells(folder, |h, row, c| {
                    let filled = h == "ie_deg" && row[0].starts_with("internal_30") && !c.is_empty();
                    filled.then(|| "0".to_owned())
                });
            })
        }),
        20 => of("ie_deg zeroed at each flexion", &["zeroed"], at_each_flexion("ie_deg")),
        21 => of("ap_mm zeroed at each flexion", &["zeroed"], at_each_flexion("ap_mm")),
        22 => of("ie_deg doubled", &["counted twice"], column("ie_deg", |x| 2.0 * x)),
        23 => of("ie_deg halved", &["counted twice"], column("ie_deg", |x| x / 2.0)),
        24 => of("kN in load_si_n", &["unit"], column("load_si_n", |x| x / 1000.0)),
        25 => of("flexion from another zero", &["another zero"], column("fe_deg", |x| x + 11.0)),
        26 => of("a jump of ap_mm", &["lies alone"], jump("ap_mm", "internal_60", 30.0)),
        27 => of("a jump of vv_deg", &["lies alone"], jump("vv_deg", "valgus_60", -12.0)),
        28 => of("si_mm of one test from another zero", &["another zero"], {
            Box::new(|folder| {
                let off = |c: &str| (c.parse::<f64>().unwrap() + 25.0).to_string();
                cells(folder, |h, row, c| (h == "si_mm" && row[1] == "anterior").then(|| off(c)));
            })
        }),
        29 => of("loads a row late", &["out of step"], shifted(&LOADS, 1)),
        30 => of("names of tests two rows late", &["out of step"], shifted(&["test"], 2)),
        31 => of("ap_mm in whole cm", &["steps"], column("ap_mm", |x| (x / 10.0).round() * 10.0)),
        32 => of("fe_deg a tenth short", &["in proportion"], column("fe_deg", |x| 0.9 * x)),
        33 => of("typeset minus", &["minus"], whole(|t| t.replace(",-", ",\u{2212}").into_bytes())),
        34 => of("negative numbers in brackets", &["brackets"], {
            Box::new(|folder| cells(folder, |h, _, c| (h == "ml_mm").then(|| bracketed(c))))
        }),
        35 => of("a code for missing readings", &["code"], {
            Box::new(|folder| {
                cells(folder, |h, row, _| (h == "ie_deg" && row[0].starts_with("varus_30")).then(|| "-999".to_owned()));
            })
        }),
        19 => of("flexion counts negative", &["negative throughout", "beyond the model"], {
            Box::new(|folder| {
                cells(folder, |h, _, c| {
                    (h == "fe_deg" || h == "nominal_flexion_deg").then(|| (-c.parse::<f64>().unwrap()).to_string())
                });
            })
        }),
        37 => of("poses a row late", &["out of step"], shifted(&POSES, 1)),
        38 => of("flexion a row late", &["out of step"], shifted(&["fe_deg"], 1)),
        39 => of("both flexions a row late", &["names say"], shifted(&["nominal_flexion_deg", "fe_deg"], 1)),
        40 => of("radians in both flexions", &["radians"], {
            Box::new(|folder| {
                let radians = |c: &str| c.parse::<f64>().unwrap().to_radians().to_string();
                cells(folder, |h, _, c| (h == "fe_deg" || h == "nominal_flexion_deg").then(|| radians(c)));
            })
        }),
        41 => of("trials pasted twice", &["twice"], {
            whole(|t| {
                let again = t.lines().skip(1).map(|row| format!("again_{row}\n")).collect::<String>();
                (t.clone() + &again).into_bytes()
            })
        }),
        42 => of("ap_mm in quarters of an inch", &["steps"], column("ap_mm", |x| (x / 6.35).round() * 6.35)),
        43 => of("centimetres in ml_mm", &["unit"], column("ml_mm", |x| x / 10.0)),
        44 => of("ap_mm times 2.54", &["unit"], column("ap_mm", |x| 2.54 * x)),
        45 => of("vv_deg and ie_deg exchanged", &["exchanged"], {
            whole(|t| t.replacen(",vv_deg,ie_deg", ",ie_deg,vv_deg", 1).into_bytes())
        }),
        46 => of("a unit in the header", &["in cm"], whole(|t| t.replacen("ml_mm", "ml_cm", 1).into_bytes())),
        48 => of("a sensor of moments not zeroed", &["zeroed"], column("load_ie_nm", |x| x + 1.5)),
        49 => of("a sensor of forces not zeroed", &["zeroed"], column("load_ap_n", |x| x - 25.0)),
        50 => of("sizes in ie_deg", &["signs dropped"], column("ie_deg", f64::abs)),
        51 => of("both flexions ten deg off the names", &["names"], {
            Box::new(|folder| {
                let ten = |c: &str| (c.parse::<f64>().unwrap() + 10.0).to_string();
                cells(folder, |h, _, c| (h == "fe_deg" || h == "nominal_flexion_deg").then(|| ten(c)));
            })
        }),
        52 => of("a web page", &["web page"], {
            whole(|t| format!("<table><tr><td>{}</td></tr></table>", t.replace(',', "</td><td>")).into_bytes())
        }),
        53 => of("a table on its side", &["its side"], {
            whole(|t| {
                let rows: Vec<Vec<&str>> = t.lines().map(|line| line.split(',').collect()).collect();
                let column = |k: usize| rows.iter().map(|row| row[k]).collect::<Vec<_>>().join(",") + "\n";
                (0..rows[0].len()).map(column).collect::<String>().into_bytes()
            })
        }),
        54 => of("sign of ie_deg at one flexion", TURNED, {
            Box::new(|folder| {
                let turned = |c: &str| (-c.parse::<f64>().unwrap()).to_string();
                cells(folder, |h, row, c| (h == "ie_deg" && row[2].starts_with("30")).then(|| turned(c)));
            })
        }),
        55 => of("kN in load_ap_n of posterior tests", &["unit"], {
            Box::new(|folder| {
                let kilo = |c: &str| (c.parse::<f64>().unwrap() / 1000.0).to_string();
                cells(folder, |h, row, c| (h == "load_ap_n" && row[1] == "posterior").then(|| kilo(c)));
            })
        }),
        56 => of("a separator at the end of each row", &["beyond the header"], {
            whole(|t| {
                let ended = |(k, line): (usize, &str)| if k == 0 { format!("{line}\n") } else { format!("{line},\n") };
                t.lines().enumerate().map(ended).collect::<String>().into_bytes()
            })
        }),
        57 => of("thousands with points among decimal commas", &["thousand"], {
            Box::new(|folder| {
                cells(folder, |h, _, _| (h == "load_si_n").then(|| "1000".to_owned()));
                let german = text(&folder.join(TABLE)).replace(',', ";").replace('.', ",").replace(";1000;", ";1.000;");
                write(&folder.join(TABLE), german);
            })
        }),
        _ => of("load_vv_nm and load_ie_nm exchanged", &["exchanged", "unit", "point that way"], {
            whole(|t| t.replacen("load_vv_nm,load_ie_nm", "load_ie_nm,load_vv_nm", 1).into_bytes())
        }),
    }
}
