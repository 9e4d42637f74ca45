//! Checks constraints and anchor queries field by field: lengths, ranges, finiteness, and what this version serves.
//!
//! Whether a hole exists is checked by the mender, which has the scan.

use darn_json::{EXCERPT_BYTES, excerpt};

use super::v1;

mod choices;
mod selector;

pub use choices::{Fill, LAST_ALTERNATIVE, PatchBuffer, TextureChoice};
pub(super) use selector::list;
pub use selector::{Border, Cut, HoleSelector, TornEdge};

/// Most entries of one list of constraints: far above any use, and cheap to check.
const MAX_ENTRIES: usize = 4096;
/// Largest absolute coordinate, in the scene's unit: its square still fits an f32, the type of a glTF's positions.
const MAX_COORDINATE: f64 = 1e18;

/// One field of a request and what is wrong with it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{pointer}{}{detail}", if .pointer.is_empty() { "" } else { ": " })]
pub struct FieldError {
    /// JSON pointer (RFC 6901) into the constraints or the query; empty for the whole. One with a caller's own long keys is cut.
    pub pointer: String,
    /// What is wrong, for a person.
    pub detail: String,
}

impl FieldError {
    /// An error at `pointer`.
    pub fn new(pointer: impl Into<String>, detail: impl Into<String>) -> Self {
        Self {
            pointer: excerpt(&pointer.into()).into_owned(),
            detail: detail.into(),
        }
    }
}

/// Checked constraints of a mend. The default selects all holes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Constraints {
    /// The holes to fill, in the request's order (entry `i` is `/holes/i`); empty selects all.
    pub holes: Vec<HoleSelector>,
    /// Points the new cloth should pass through (entry `i` is `/anchors/i`).
    pub anchors: Vec<Anchor>,
    /// Gestures on the new cloth, in order (entry `i` is `/edits/i`).
    pub edits: Vec<Edit>,
    /// Name of the weights; `None` leaves the choice to the mender.
    pub weights: Option<String>,
    /// Direction opposite to gravity in scene space; any length above zero.
    pub up: Option<[f64; 3]>,
    /// Which loops are filled beside those that `holes` names; `None`: holes, or none beside the named ones.
    pub fill: Option<Fill>,
    /// Unnamed loops outside these diameters are left.
    pub diameters: Diameters,
    /// Ids of loops to leave (entry `i` is `/except/i`).
    pub except: Vec<u32>,
    /// Whether patches that are no plausible cloth are applied.
    pub accept_doubtful: bool,
    /// Where the patches' colours come from; `None` leaves it to the mender.
    pub texture: Option<TextureChoice>,
    /// Which of the plausible fills is applied, 0 (the likeliest) to [`LAST_ALTERNATIVE`]; `None` leaves it to the mender.
    pub alternative: Option<u8>,
    /// Where the patches of a glTF go that came in several files.
    pub patch_buffer: PatchBuffer,
}

/// A range of loop diameters, both ends included, in the scene's unit. The default has no ends.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Diameters {
    /// The least.
    pub min: Option<f64>,
    /// The largest.
    pub max: Option<f64>,
}

/// A point the new cloth should pass through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// The id of its hole; may be `None` when only one hole is filled.
    pub hole: Option<u32>,
    /// Its uv on the hole's chart, in [0, 1]²; `None` has it searched.
    pub uv: Option<[f64; 2]>,
    /// Its position in scene space, in the scene's unit.
    pub position: [f64; 3],
    /// Whether the mend fails unless the cloth passes through it.
    pub hard: bool,
}

/// A gesture on the new cloth of a hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edit {
    /// The id of its hole; may be `None` when only one hole is filled.
    pub hole: Option<u32>,
    /// The deformation.
    pub gesture: Gesture,
}

/// A deformation of the cloth of a hole. Uvs and radii are on the hole's chart, in [0, 1]; offsets and axes in scene space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gesture {
    /// Pulls a point by an offset.
    Grab {
        /// The point.
        uv: [f64; 2],
        /// Displacement, in the scene's unit.
        offset: [f64; 3],
    },
    /// Rotates a disk.
    Twist {
        /// Its centre.
        uv: [f64; 2],
        /// Its radius, in (0, 1].
        radius: f64,
        /// Axis of the rotation; any length above zero.
        axis: [f64; 3],
        /// Angle of the rotation, in radians.
        angle: f64,
    },
    /// Draws two points together.
    Pinch {
        /// The points.
        uvs: [[f64; 2]; 2],
        /// The part of their distance to remove, in [0, 1].
        amount: f64,
    },
}

/// A checked query of an anchor search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// The id of the hole; may be `None` when the scan has only one.
    pub hole: Option<u32>,
    /// The point in scene space that the cloth should reach, in the scene's unit.
    pub target: [f64; 3],
    /// The uv at which the search starts, in [0, 1]²; `None` starts where the unedited cloth is nearest.
    pub start: Option<[f64; 2]>,
    /// Whether every hole cell is evaluated.
    pub exhaustive: bool,
    /// Whether the answer carries the loss of every cell.
    pub map: bool,
    /// Whether it also carries its gradient there.
    pub map_gradient: bool,
}

impl Constraints {
    /// Checks a message field by field.
    ///
    /// # Errors
    /// Every field that is invalid or not served yet, in the message's order.
    pub fn check(message: &v1::Constraints) -> Result<Self, Vec<FieldError>> {
        let mut errors = FieldErrors::default();
        errors.count("/holes", message.holes.len());
        errors.count("/anchors", message.anchors.len());
        errors.count("/edits", message.edits.len());
        errors.count("/except", message.except.len());
        if !errors.0.is_empty() {
            return Err(errors.0);
        }

        let holes = (message.holes.iter().enumerate())
            .filter_map(|(i, hole)| errors.hole(&format!("/holes/{i}"), hole))
            .collect();
        let anchors = (message.anchors.iter().enumerate())
            .filter_map(|(i, anchor)| errors.anchor(&format!("/anchors/{i}"), anchor))
            .collect();
        let edits = (message.edits.iter().enumerate())
            .filter_map(|(i, edit)| errors.edit(&format!("/edits/{i}"), edit))
            .collect();
        let up = match message.up.as_slice() {
            [] => None,
            up => errors.direction("/up", up),
        };
        errors.name("/weights", message.weights.as_deref());
        let fill = (message.fill.as_deref()).and_then(|fill| errors.fill(fill));
        let texture = (message.texture.as_deref()).and_then(|texture| errors.texture(texture));
        let alternative = (message.alternative).and_then(|number| errors.alternative(number));
        let patch_buffer = (message.patch_buffer.as_deref()).and_then(|it| errors.patch_buffer(it));
        let diameters = Diameters {
            max: errors.diameter("/maxDiameter", message.max_diameter),
            min: errors.diameter("/minDiameter", message.min_diameter),
        };
        if let Diameters {
            min: Some(min),
            max: Some(max),
        } = diameters
            && min > max
        {
            errors.push("/minDiameter", format!("{min} is above maxDiameter, {max}"));
        }
        if errors.0.is_empty() {
            Ok(Self {
                holes,
                anchors,
                edits,
                weights: message.weights.clone(),
                up,
                fill,
                diameters,
                except: message.except.clone(),
                accept_doubtful: message.accept_doubtful,
                texture,
                alternative,
                patch_buffer: patch_buffer.unwrap_or_default(),
            })
        } else {
            Err(errors.0)
        }
    }
}

impl Search {
    /// Checks a message field by field.
    ///
    /// # Errors
    /// Every invalid field, in the message's order.
    pub fn check(message: &v1::AnchorQuery) -> Result<Self, Vec<FieldError>> {
        let mut errors = FieldErrors::default();
        let target = errors.point("/target", &message.target);
        let start = match message.start.as_slice() {
            [] => None,
            start => errors.uv("/start", start),
        };
        match target {
            Some(target) if errors.0.is_empty() => Ok(Self {
                hole: message.hole,
                target,
                start,
                exhaustive: message.exhaustive,
                map: message.map || message.map_gradient,
                map_gradient: message.map_gradient,
            }),
            _ => Err(errors.0),
        }
    }
}

/// Collects the errors of a message while its fields are read; a reader returns `None` after it has recorded an error.
#[derive(Default)]
struct FieldErrors(Vec<FieldError>);

impl FieldErrors {
    fn push(&mut self, pointer: &str, detail: impl Into<String>) {
        self.0.push(FieldError::new(pointer, detail));
    }

    fn count(&mut self, pointer: &str, count: usize) {
        if count > MAX_ENTRIES {
            self.push(
                pointer,
                format!("{count} entries; the limit is {MAX_ENTRIES}"),
            );
        }
    }

    /// A name is repeated in errors and reports.
    fn name(&mut self, at: &str, name: Option<&str>) {
        let length = name.map_or(0, str::len);
        if length > EXCERPT_BYTES {
            self.push(
                at,
                format!("a name of {length} bytes; the limit is {EXCERPT_BYTES}"),
            );
        }
    }

    fn diameter(&mut self, at: &str, diameter: Option<f64>) -> Option<f64> {
        let diameter = diameter?;
        let expected = "expected a diameter in the scene's unit, 0 to 1e18";
        self.number(
            at,
            Some(diameter),
            |x| (0.0..=MAX_COORDINATE).contains(&x),
            expected,
        )
    }

    fn anchor(&mut self, at: &str, anchor: &v1::Anchor) -> Option<Anchor> {
        let uv = match anchor.uv.as_slice() {
            [] => Some(None),
            uv => self.uv(&format!("{at}/uv"), uv).map(Some),
        };
        let position = self.point(&format!("{at}/position"), &anchor.position);
        Some(Anchor {
            hole: anchor.hole,
            uv: uv?,
            position: position?,
            hard: anchor.hard,
        })
    }

    fn edit(&mut self, at: &str, edit: &v1::Edit) -> Option<Edit> {
        let gesture = match &edit.gesture {
            None => {
                self.push(
                    at,
                    "exactly one of `grab`, `twist` and `pinch` says what to do",
                );
                return None;
            }
            Some(v1::edit::Gesture::Grab(grab)) => {
                let at = format!("{at}/grab");
                let uv = self.uv(&format!("{at}/uv"), &grab.uv);
                let offset = self.point(&format!("{at}/offset"), &grab.offset);
                Gesture::Grab {
                    uv: uv?,
                    offset: offset?,
                }
            }
            Some(v1::edit::Gesture::Twist(twist)) => {
                let at = format!("{at}/twist");
                let is_angle = |x: f64| x.is_finite();
                let is_radius = |x: f64| x > 0.0 && x <= 1.0;
                let uv = self.uv(&format!("{at}/uv"), &twist.uv);
                let expected = "expected a number above 0, at most 1";
                let radius =
                    self.number(&format!("{at}/radius"), twist.radius, is_radius, expected);
                let axis = self.direction(&format!("{at}/axis"), &twist.axis);
                let expected = "expected a finite number of radians";
                let angle = self.number(&format!("{at}/angle"), twist.angle, is_angle, expected);
                Gesture::Twist {
                    uv: uv?,
                    radius: radius?,
                    axis: axis?,
                    angle: angle?,
                }
            }
            Some(v1::edit::Gesture::Pinch(pinch)) => {
                let at = format!("{at}/pinch");
                let ends = if let [a, b] = pinch.uvs.as_slice() {
                    let a = self.uv(&format!("{at}/uvs/0"), &numbers(a));
                    let b = self.uv(&format!("{at}/uvs/1"), &numbers(b));
                    a.zip(b)
                } else {
                    let count = pinch.uvs.len();
                    self.push(
                        &format!("{at}/uvs"),
                        format!("expected two uvs; got {count}"),
                    );
                    None
                };
                let is_share = |x: f64| (0.0..=1.0).contains(&x);
                let expected = "expected a number from 0 to 1";
                let amount = self.number(&format!("{at}/amount"), pinch.amount, is_share, expected);
                let (a, b) = ends?;
                Gesture::Pinch {
                    uvs: [a, b],
                    amount: amount?,
                }
            }
        };
        Some(Edit {
            hole: edit.hole,
            gesture,
        })
    }

    fn number(
        &mut self,
        at: &str,
        number: Option<f64>,
        is_valid: fn(f64) -> bool,
        expected: &str,
    ) -> Option<f64> {
        match number {
            Some(x) if is_valid(x) => Some(x),
            Some(x) => {
                self.push(at, format!("{expected}; got {x}"));
                None
            }
            None => {
                self.push(at, format!("{expected}; got none"));
                None
            }
        }
    }

    fn direction(&mut self, at: &str, numbers: &[f64]) -> Option<[f64; 3]> {
        let direction = self.point(at, numbers)?;
        let length2: f64 = direction.iter().map(|x| x * x).sum();
        if length2 > f64::MIN_POSITIVE {
            return Some(direction);
        }
        self.push(at, "a direction has a length; got zero");
        None
    }

    fn point(&mut self, at: &str, numbers: &[f64]) -> Option<[f64; 3]> {
        let Ok(point) = <[f64; 3]>::try_from(numbers) else {
            self.push(
                at,
                format!("a point is [x, y, z]; got {} numbers", numbers.len()),
            );
            return None;
        };
        self.all(
            at,
            &point,
            |x| x.abs() <= MAX_COORDINATE,
            "expected a finite coordinate, at most 1e18 in size",
        )
        .then_some(point)
    }

    fn uv(&mut self, at: &str, numbers: &[f64]) -> Option<[f64; 2]> {
        let Ok(uv) = <[f64; 2]>::try_from(numbers) else {
            self.push(at, format!("a uv is [u, v]; got {} numbers", numbers.len()));
            return None;
        };
        self.all(
            at,
            &uv,
            |x| (0.0..=1.0).contains(&x),
            "expected a number from 0 to 1",
        )
        .then_some(uv)
    }

    /// Whether every number is valid; the predicates reject NaN.
    fn all(
        &mut self,
        at: &str,
        numbers: &[f64],
        is_valid: fn(f64) -> bool,
        expected: &str,
    ) -> bool {
        let before = self.0.len();
        for (i, &number) in numbers.iter().enumerate() {
            if !is_valid(number) {
                self.push(&format!("{at}/{i}"), format!("{expected}; got {number}"));
            }
        }
        self.0.len() == before
    }
}

/// The numbers of a JSON list; any other value becomes NaN, which every check rejects.
fn numbers(list: &pbjson_types::ListValue) -> Vec<f64> {
    use pbjson_types::value::Kind;
    let number = |value: &pbjson_types::Value| match value.kind {
        Some(Kind::NumberValue(x)) => x,
        _ => f64::NAN,
    };
    list.values.iter().map(number).collect()
}

#[cfg(test)]
#[path = "validate_tests.rs"]
mod tests;
