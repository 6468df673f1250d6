//! Shell completions and manual pages, from the command line's own description.

use crate::error::BuildError;
use crate::store;
use clap_complete::Shell;
use std::path::Path;

/// The script that completes `build-model` in a shell.
pub fn completions(shell: Shell, mut command: clap::Command) -> String {
    let mut out = Vec::new();
    clap_complete::generate(shell, &mut command, "build-model", &mut out);
    String::from_utf8_lossy(&out).into_owned()
}

/// The manual page as roff; with a folder, a page for every command is written there.
pub fn pages(out: Option<&Path>, mut all: clap::Command) -> Result<String, BuildError> {
    all.build();
    let Some(out) = out else { return page(all) };
    let mut text = String::new();
    let inner: Vec<clap::Command> = all.get_subcommands().cloned().collect();
    for (name, one) in std::iter::once(("build-model".to_owned(), all))
        .chain(inner.into_iter().map(|c| (format!("build-model-{}", c.get_name()), c)))
    {
        let path = out.join(format!("{name}.1"));
        store::write(&path, page(one)?.as_bytes())?;
        text += &format!("{}\n", path.display());
    }
    Ok(text)
}

fn page(command: clap::Command) -> Result<String, BuildError> {
    let mut out = Vec::new();
    clap_mangen::Man::new(command).render(&mut out).map_err(|e| BuildError::File(format!("manual page: {e}")))?;
    Ok(String::from_utf8_lossy(&out).into_owned())
}
