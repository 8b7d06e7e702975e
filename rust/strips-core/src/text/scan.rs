//! Reading atoms off a text, from left to right and without copying.

/// An atom as it stands in a text: a name and the names of its arguments.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TextAtom<'a> {
    /// Predicate or action word.
    pub name: &'a str,
    /// Arguments, in order.
    pub args: Vec<&'a str>,
}

/// Where a text stops making sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("byte {offset}: expected {expected}")]
pub struct Malformed {
    /// Byte offset of the first thing that does not fit.
    pub offset: usize,
    /// What would have fitted.
    pub expected: &'static str,
}

/// Whether white space must be exactly as rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Spacing {
    /// Single spaces only, so that rendering gives the same bytes again.
    Exact,
    /// Any white space, or none where two things are told apart without it.
    Free,
}

/// A position in a text.
#[derive(Clone, Debug)]
pub(crate) struct Scanner<'a> {
    text: &'a str,
    position: usize,
    spacing: Spacing,
}

impl<'a> Scanner<'a> {
    pub(crate) fn new(text: &'a str, spacing: Spacing) -> Self {
        Self { text, position: 0, spacing }
    }

    pub(crate) fn rest(&self) -> &'a str {
        &self.text[self.position..]
    }

    pub(crate) fn at_end(&self) -> bool {
        self.position == self.text.len()
    }

    pub(crate) fn malformed(&self, expected: &'static str) -> Malformed {
        Malformed { offset: self.position, expected }
    }

    /// Skips `wanted` if it comes next.
    pub(crate) fn literal(&mut self, wanted: &str) -> bool {
        let found = self.rest().starts_with(wanted);
        self.position += if found { wanted.len() } else { 0 };
        found
    }

    /// Skips the white space between two things; false where there should be some and is none.
    pub(crate) fn space(&mut self) -> bool {
        match self.spacing {
            Spacing::Exact => self.literal(" "),
            Spacing::Free => {
                let rest = self.rest();
                self.position += rest.len() - rest.trim_start().len();
                true
            }
        }
    }

    /// A non-empty run of characters that may stand in a name.
    pub(crate) fn name(&mut self) -> Option<&'a str> {
        let rest = self.rest();
        let length = rest.bytes().position(|byte| !in_name(byte)).unwrap_or(rest.len());
        self.position += length;
        (length > 0).then(|| &rest[..length])
    }

    /// An atom `name(arg, …)`; its arguments replace what is in `args`.
    pub(crate) fn atom(&mut self, args: &mut Vec<&'a str>) -> Result<&'a str, Malformed> {
        args.clear();
        let name = self.name().ok_or_else(|| self.malformed("a name"))?;
        self.expect("(", "`(`")?;
        while !self.literal(")") {
            if !args.is_empty() {
                self.expect(",", "`,` or `)`")?;
                self.expect_space()?;
            }
            args.push(self.name().ok_or_else(|| self.malformed("an argument"))?);
        }
        Ok(name)
    }

    /// Calls `item` for each of a list separated by commas, which may be empty; stops before the next marker.
    pub(crate) fn list(&mut self, mut item: impl FnMut(&mut Self) -> Result<(), Malformed>) -> Result<(), Malformed> {
        if self.at_end() || self.rest().starts_with('<') {
            return Ok(());
        }
        loop {
            item(self)?;
            if !self.literal(",") {
                return Ok(());
            }
            self.expect_space()?;
        }
    }

    /// A list of atoms.
    pub(crate) fn atoms(&mut self) -> Result<Vec<TextAtom<'a>>, Malformed> {
        let mut atoms = Vec::new();
        self.list(|scanner| {
            let mut args = Vec::new();
            let name = scanner.atom(&mut args)?;
            atoms.push(TextAtom { name, args });
            Ok(())
        })?;
        Ok(atoms)
    }

    pub(crate) fn expect(&mut self, wanted: &str, expected: &'static str) -> Result<(), Malformed> {
        if self.literal(wanted) { Ok(()) } else { Err(self.malformed(expected)) }
    }

    fn expect_space(&mut self) -> Result<(), Malformed> {
        if self.space() { Ok(()) } else { Err(self.malformed("a space")) }
    }
}

/// Whether the byte may stand in a name: anything but white space, control characters and the format's punctuation.
pub(crate) fn in_name(byte: u8) -> bool {
    byte > b' ' && !matches!(byte, b'(' | b')' | b',' | b'<' | b'>' | 0x7F)
}
