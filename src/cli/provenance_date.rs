//! The date that the provenance of a mend is given.

use chrono::{DateTime, NaiveDate, Timelike};

/// A day, or an instant with its zone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MendDate {
    /// As it was written.
    pub text: String,
    /// Its type in XML Schema: `xsd:date` or `xsd:dateTime`.
    pub datatype: &'static str,
}

impl MendDate {
    /// A day such as `2026-11-28`, or an instant as RFC 3339 writes it.
    ///
    /// # Errors
    /// Text that is neither, or names a day or a time that does not exist. Leap seconds count as such: XML Schema has none.
    pub fn parsed(text: &str) -> Result<Self, String> {
        let datatype = if is_day(text) {
            "xsd:date"
        } else if is_instant(text) {
            "xsd:dateTime"
        } else {
            return Err(
                "must be a day such as 2026-11-28, or an instant such as 2026-11-28T09:30:00Z"
                    .to_owned(),
            );
        };
        Ok(Self {
            text: text.to_owned(),
            datatype,
        })
    }
}

fn is_day(text: &str) -> bool {
    let day = NaiveDate::parse_from_str(text, "%Y-%m-%d");
    // The parser also takes days and months of one digit, and years of more than four.
    day.is_ok_and(|day| day.to_string() == text && text.len() == 10)
}

fn is_instant(text: &str) -> bool {
    const NANOSECONDS: u32 = 1_000_000_000;
    let instant = DateTime::parse_from_rfc3339(text);
    // RFC 3339 also allows small letters and a space between day and time; XML Schema does not.
    let is_spelled = text.get(10..11) == Some("T") && !text.ends_with('z');
    is_spelled && instant.is_ok_and(|instant| instant.nanosecond() < NANOSECONDS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_and_instants_that_exist_are_taken_as_they_are_written() {
        for (good, datatype) in [
            ("2026-11-28", "xsd:date"),
            ("2028-02-29", "xsd:date"),
            ("2026-11-28T09:30:00Z", "xsd:dateTime"),
            ("2026-11-28T09:30:00.25+01:00", "xsd:dateTime"),
            ("2026-11-28T23:59:59-00:00", "xsd:dateTime"),
        ] {
            let found = MendDate::parsed(good);
            let expected = MendDate {
                text: good.to_owned(),
                datatype,
            };
            assert_eq!(found, Ok(expected));
        }
    }

    #[test]
    fn what_is_no_day_and_no_instant_is_refused() {
        for bad in [
            "",
            "today",
            "28.11.2026",
            "2026-1-5",
            "+2026-11-28",
            "12026-11-28",
            "2026-99-99",
            "2026-02-29",
            "2026-00-10",
            "2026-11-28 ",
            "2026-11-28T09:30",
            "2026-11-28T09:30:00",
            "2026-11-28T99:99:99Z",
            "2026-11-28T24:00:00Z",
            "2026-11-28T23:59:60Z",
            "2026-11-28T09:30:00.zzzZ",
            "2026-11-28T09:30:00.Z",
            "2026-11-28T09:30:00z",
            "2026-11-28t09:30:00Z",
            "2026-11-28 09:30:00Z",
            "2026-11-28T09:30:00+99:00",
        ] {
            assert!(MendDate::parsed(bad).is_err(), "{bad}");
        }
    }
}
