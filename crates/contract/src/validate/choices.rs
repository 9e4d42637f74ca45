//! What a request chooses by a word or a number.

use darn_json::excerpt;

use super::FieldErrors;

/// The number of the last of the plausible fills of a hole.
pub const LAST_ALTERNATIVE: u8 = 7;

/// Where the colour of a patch comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextureChoice {
    /// Images of its own, completed from the cloth around it.
    Synthesize,
    /// The scan's texture coordinates and colours, continued from the rim.
    Continue,
    /// One colour: the mean of the cloth around it.
    Flat,
    /// Grey.
    None,
}

/// Where the patches of a glTF go that came in several files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PatchBuffer {
    /// Into the glTF, in a data URI.
    #[default]
    Data,
    /// Into a file of their own.
    File,
}

/// Kinds of loops to fill. None of them includes outer boundaries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fill {
    /// Damage.
    Holes,
    /// Finished openings and the ends of tubes.
    Openings,
    /// Both.
    All,
}

impl FieldErrors {
    pub(super) fn fill(&mut self, fill: &str) -> Option<Fill> {
        match fill {
            "holes" => Some(Fill::Holes),
            "openings" => Some(Fill::Openings),
            "all" => Some(Fill::All),
            other => {
                let got = excerpt(other);
                let detail = format!("expected `holes`, `openings` or `all`; got `{got}`");
                self.push("/fill", detail);
                None
            }
        }
    }

    pub(super) fn texture(&mut self, texture: &str) -> Option<TextureChoice> {
        match texture {
            "synthesize" => Some(TextureChoice::Synthesize),
            "continue" => Some(TextureChoice::Continue),
            "flat" => Some(TextureChoice::Flat),
            "none" => Some(TextureChoice::None),
            other => {
                let got = excerpt(other);
                let detail =
                    format!("expected `synthesize`, `continue`, `flat` or `none`; got `{got}`");
                self.push("/texture", detail);
                None
            }
        }
    }

    pub(super) fn patch_buffer(&mut self, buffer: &str) -> Option<PatchBuffer> {
        match buffer {
            "data" => Some(PatchBuffer::Data),
            "file" => Some(PatchBuffer::File),
            other => {
                let got = excerpt(other);
                self.push(
                    "/patchBuffer",
                    format!("expected `data` or `file`; got `{got}`"),
                );
                None
            }
        }
    }

    pub(super) fn alternative(&mut self, number: u32) -> Option<u8> {
        let known = u8::try_from(number).ok().filter(|k| *k <= LAST_ALTERNATIVE);
        if known.is_none() {
            let detail =
                format!("expected a whole number from 0 to {LAST_ALTERNATIVE}; got {number}");
            self.push("/alternative", detail);
        }
        known
    }
}
