//! What a completion reads: the cloth around a hole with its images, and the patch, both in the chart.

/// An 8-bit image in memory. Row 0 is at v = 0, as in glTF.
#[derive(Debug, Clone, Copy)]
pub struct SourceImage<'a> {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width` × `height` texels, row by row.
    pub texels: &'a [[u8; 4]],
}

/// What a sampler does with texture coordinates outside of 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The image is repeated.
    #[default]
    Repeat,
    /// The image is repeated, every second time mirrored.
    Mirror,
    /// The texels at the border go on.
    Clamp,
}

/// How the texels of a layer are read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LayerKind {
    /// sRGB colour and linear alpha, multiplied by vertex colours.
    BaseColour,
    /// sRGB colour, such as emission or sheen colour.
    Colour,
    /// Tangent-space normals.
    Normal,
    /// A direction in the tangent plane in red and green; a linear number in blue.
    Direction,
    /// Linear numbers, such as occlusion, roughness and metallic.
    Data,
}

impl LayerKind {
    /// Whether red, green and blue are sRGB-encoded.
    pub(crate) fn is_srgb(self) -> bool {
        matches!(self, LayerKind::BaseColour | LayerKind::Colour)
    }

    /// Whether red and green are the coordinates of a vector, which turns with the image.
    pub(crate) fn is_vector(self) -> bool {
        matches!(self, LayerKind::Normal | LayerKind::Direction)
    }
}

/// A layer of one material.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// Without an image the layer is `factor` everywhere.
    pub image: Option<SourceImage<'a>>,
    /// Index into [`Cloth::texcoords`].
    pub texcoords: usize,
    /// For u and v.
    pub wrap: [Wrap; 2],
    /// Multiplied with the decoded (linear) texels. For [`LayerKind::Normal`] the first number is the normal scale.
    pub factor: [f32; 4],
}

/// The texture coordinates at the corners of every face.
pub type CornerTexcoords = Vec<[[f32; 2]; 3]>;

/// The cloth around a hole.
#[derive(Debug, Clone, Default)]
pub struct Cloth<'a> {
    /// Positions in the chart, scene units. Faces that show their front are counter-clockwise.
    pub flat: Vec<[f64; 2]>,
    /// Triangles as indices into `flat`.
    pub faces: Vec<[u32; 3]>,
    /// Per face: index into `materials`.
    pub material_of: Vec<u32>,
    /// Sets of texture coordinates per face, after `KHR_texture_transform`. Each as long as `faces`.
    pub texcoords: Vec<CornerTexcoords>,
    /// Per face: the vertex colours at its corners, linear; empty when there are none.
    pub colours: Vec<[[f32; 4]; 3]>,
    /// The layers that the patch's texture will have, in order.
    pub layers: Vec<LayerKind>,
    /// Per material: one source for every layer.
    pub materials: Vec<Vec<Source<'a>>>,
}

/// The patch in the same chart.
#[derive(Debug, Clone, Default)]
pub struct PatchChart {
    /// Positions in the chart, scene units.
    pub flat: Vec<[f64; 2]>,
    /// Triangles as indices into `flat`, counter-clockwise as the cloth's.
    pub faces: Vec<[u32; 3]>,
}

/// Limits and choices of a completion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Texels that a side of the working raster may have at most; the patch's image is a part of it.
    pub max_side: u32,
    /// Texels around the patch in its image, against bleeding in smaller mip levels.
    pub margin: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            max_side: 2048,
            margin: 8,
        }
    }
}

/// Why a patch gets no texture of its own.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TextureError {
    /// The request has ended.
    #[error(transparent)]
    Exhausted(#[from] darn_budget::Exhausted),
    /// No layer, no face around the hole, or no face of the patch.
    #[error("there is no {0} to take colour from or to")]
    Nothing(&'static str),
    /// Arrays whose lengths or indices contradict each other.
    #[error("{0}")]
    Inconsistent(&'static str),
    /// The cloth has no texture coordinates that could be measured against the chart.
    #[error("the texture coordinates around the hole have no area")]
    NoDensity,
}

impl Cloth<'_> {
    /// Checks lengths and indices.
    pub(crate) fn check(&self) -> Result<(), TextureError> {
        if self.layers.is_empty() {
            return Err(TextureError::Nothing("layer"));
        }
        if self.faces.is_empty() {
            return Err(TextureError::Nothing("cloth"));
        }
        let faces = self.faces.len();
        let inconsistent = |text| Err(TextureError::Inconsistent(text));
        if self.material_of.len() != faces
            || self.texcoords.iter().any(|set| set.len() != faces)
            || !(self.colours.is_empty() || self.colours.len() == faces)
        {
            return inconsistent("an array of the cloth is not as long as its faces");
        }
        if (self.faces.iter().flatten()).any(|v| *v as usize >= self.flat.len()) {
            return inconsistent("a face of the cloth names a vertex that is not there");
        }
        if (self.material_of.iter()).any(|m| *m as usize >= self.materials.len()) {
            return inconsistent("a face of the cloth names a material that is not there");
        }
        if (self.materials.iter()).any(|sources| sources.len() != self.layers.len()) {
            return inconsistent("a material has not one source for every layer");
        }
        for source in self.materials.iter().flatten() {
            let Some(image) = source.image else { continue };
            if source.texcoords >= self.texcoords.len() {
                return inconsistent("a source names texture coordinates that are not there");
            }
            let texels = u64::from(image.width) * u64::from(image.height);
            if texels == 0 || texels != image.texels.len() as u64 {
                return inconsistent("an image has not as many texels as its size says");
            }
        }
        Ok(())
    }
}

impl PatchChart {
    /// Checks lengths and indices.
    pub(crate) fn check(&self) -> Result<(), TextureError> {
        if self.faces.is_empty() {
            return Err(TextureError::Nothing("patch"));
        }
        if (self.faces.iter().flatten()).any(|v| *v as usize >= self.flat.len()) {
            let text = "a face of the patch names a vertex that is not there";
            return Err(TextureError::Inconsistent(text));
        }
        Ok(())
    }
}
