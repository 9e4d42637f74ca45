//! Which process keeps a session: several processes may serve together behind one address, and each keeps its sessions in its own memory.
//!
//! A session's id is a UUID of version 8 (RFC 9562, section 5.8): 48 bits name the instance, so that a proxy can send a request where its
//! session is; 12 bits tell one start of that instance from the next; 62 bits are random.

use std::{fmt, str::FromStr};

use uuid::{Builder, Uuid, Variant};

/// Bits of an instance's name.
const NAME_BITS: u32 = 48;
/// Hexadecimal digits of an instance's name.
const NAME_DIGITS: usize = NAME_BITS as usize / 4;

/// The name of a process among those that serve together.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct InstanceName(u64);

impl InstanceName {
    /// A name that no other process has, but for one chance in 2⁴⁸.
    pub fn random() -> Self {
        Self(Uuid::new_v4().as_u64_pair().1 & ((1 << NAME_BITS) - 1))
    }
}

impl FromStr for InstanceName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_hexadecimal = text.bytes().all(|b| b.is_ascii_hexdigit());
        let name = u64::from_str_radix(text, 16).ok();
        name.filter(|_| is_hexadecimal && text.len() <= NAME_DIGITS)
            .map(Self)
            .ok_or_else(|| {
                format!("must be 1 to {NAME_DIGITS} hexadecimal digits, such as 1 or a7")
            })
    }
}

impl fmt::Display for InstanceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:0NAME_DIGITS$x}", self.0)
    }
}

impl fmt::Debug for InstanceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "InstanceName({self})")
    }
}

/// This process among those that serve together.
#[derive(Debug, Clone, Copy)]
pub struct Instance {
    name: InstanceName,
    /// Tells this start of the instance from others.
    start: u16,
}

/// Where a session is kept, by its id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SessionPlace {
    /// In this process.
    Here,
    /// In an earlier process of the same name.
    BeforeRestart,
    /// In another instance.
    At(InstanceName),
    /// No instance makes such an id.
    Nowhere,
}

impl Instance {
    /// An instance that starts now.
    pub fn new(name: InstanceName) -> Self {
        let start = Uuid::new_v4().as_u64_pair().1 as u16 & 0xfff;
        Self { name, start }
    }

    /// Its name.
    pub fn name(&self) -> InstanceName {
        self.name
    }

    /// An id for a new session.
    pub fn session_id(&self) -> Uuid {
        let (_, random) = Uuid::new_v4().as_u64_pair();
        let bytes =
            u128::from(self.name.0) << 80 | u128::from(self.start) << 64 | u128::from(random);
        Builder::from_custom_bytes(bytes.to_be_bytes()).into_uuid()
    }

    /// Where the session of an id is kept.
    pub fn place_of(&self, session: Uuid) -> SessionPlace {
        if session.get_version_num() != 8 || session.get_variant() != Variant::RFC4122 {
            return SessionPlace::Nowhere;
        }
        let (high, _) = session.as_u64_pair();
        let name = InstanceName(high >> 16);
        if name != self.name {
            SessionPlace::At(name)
        } else if high as u16 & 0xfff == self.start {
            SessionPlace::Here
        } else {
            SessionPlace::BeforeRestart
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_are_hexadecimal() {
        for (text, shown) in [
            ("1", "000000000001"),
            ("A7", "0000000000a7"),
            ("ffffffffffff", "ffffffffffff"),
        ] {
            assert_eq!(text.parse::<InstanceName>().unwrap().to_string(), shown);
        }
        for bad in ["", "+1", "g", "0000000000001", "a b"] {
            assert!(bad.parse::<InstanceName>().is_err(), "{bad}");
        }
    }

    #[test]
    fn ids_that_no_instance_makes_are_nowhere() {
        let instance = Instance::new(InstanceName::random());
        for id in [Uuid::nil(), Uuid::max(), Uuid::new_v4()] {
            assert_eq!(instance.place_of(id), SessionPlace::Nowhere);
        }
    }

    proptest! {
        #[test]
        fn an_id_tells_where_its_session_is(name in 0u64..1 << 48, other in 0u64..1 << 48, start in 0u16..4096) {
            let here = Instance { name: InstanceName(name), start };
            let restarted = Instance { start: start ^ 1, ..here };
            let id = here.session_id();
            prop_assert!(id.to_string().replace('-', "").starts_with(&here.name.to_string()));
            prop_assert_eq!(here.place_of(id), SessionPlace::Here);
            prop_assert_eq!(restarted.place_of(id), SessionPlace::BeforeRestart);
            prop_assert_ne!(id, here.session_id());
            if name != other {
                let elsewhere = Instance::new(InstanceName(other));
                prop_assert_eq!(elsewhere.place_of(id), SessionPlace::At(here.name));
            }
        }
    }
}
