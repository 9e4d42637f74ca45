//! The values that go into statements and come out of rows, in both databases.

use uuid::Uuid;

use crate::error::JobError;

/// A value with its type; NULL where there is none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Value {
    Int(Option<i64>),
    Text(Option<String>),
    Id(Option<Uuid>),
}

/// The arguments of a statement, `$1` first.
macro_rules! args {
    ($($value:expr),* $(,)?) => { vec![$($crate::engine::Value::from($value)),*] };
}
pub(crate) use args;

macro_rules! value_from {
    ($($kind:ident: $type:ty),*) => {$(
        impl From<$type> for Value {
            fn from(value: $type) -> Self {
                Self::$kind(Some(value))
            }
        }

        impl From<Option<$type>> for Value {
            fn from(value: Option<$type>) -> Self {
                Self::$kind(value)
            }
        }
    )*};
}
value_from!(Int: i64, Text: String, Id: Uuid);

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::Text(Some(value.to_owned()))
    }
}

/// A row of an answer.
#[derive(Debug)]
pub(crate) struct Row {
    columns: Vec<(String, Value)>,
}

impl Row {
    pub(crate) fn new(columns: Vec<(String, Value)>) -> Self {
        Self { columns }
    }

    fn value(&self, name: &str) -> Result<&Value, JobError> {
        (self.columns.iter())
            .find(|(column, _)| column == name)
            .map(|(_, value)| value)
            .ok_or_else(|| JobError::UnexpectedValue(name.to_owned()))
    }

    /// A whole number, or nothing for NULL.
    pub(crate) fn int(&self, name: &str) -> Result<Option<i64>, JobError> {
        match self.value(name)? {
            Value::Int(value) => Ok(*value),
            Value::Text(None) | Value::Id(None) => Ok(None),
            _ => Err(JobError::UnexpectedValue(name.to_owned())),
        }
    }

    /// A text, or nothing for NULL.
    pub(crate) fn text(&self, name: &str) -> Result<Option<String>, JobError> {
        match self.value(name)? {
            Value::Text(value) => Ok(value.clone()),
            Value::Int(None) | Value::Id(None) => Ok(None),
            _ => Err(JobError::UnexpectedValue(name.to_owned())),
        }
    }

    /// An id, or nothing for NULL.
    pub(crate) fn id(&self, name: &str) -> Result<Option<Uuid>, JobError> {
        match self.value(name)? {
            Value::Id(value) => Ok(*value),
            Value::Int(None) | Value::Text(None) => Ok(None),
            _ => Err(JobError::UnexpectedValue(name.to_owned())),
        }
    }

    /// What must be there: `row.some("version", Row::int)`.
    pub(crate) fn some<T>(
        &self,
        name: &str,
        get: impl Fn(&Self, &str) -> Result<Option<T>, JobError>,
    ) -> Result<T, JobError> {
        get(self, name)?.ok_or_else(|| JobError::UnexpectedValue(name.to_owned()))
    }
}

/// A query with its arguments, for either database.
macro_rules! bound {
    ($sql:expr, $args:expr) => {{
        let mut query = sqlx::query($sql);
        for value in $args {
            query = match value {
                $crate::engine::Value::Int(value) => query.bind(value),
                $crate::engine::Value::Text(value) => query.bind(value),
                $crate::engine::Value::Id(value) => query.bind(value),
            };
        }
        query
    }};
}
pub(crate) use bound;

/// The values of a database's row, by the database's names of the types that our tables use.
macro_rules! decoded {
    ($row:expr, int: $int:pat, text: $text:pat, id: $id:pat) => {{
        use sqlx::{Column, Row as _, TypeInfo, ValueRef};
        let row = $row;
        let mut columns = Vec::with_capacity(row.len());
        for column in row.columns() {
            let place = column.ordinal();
            let raw = row.try_get_raw(place)?;
            let value = match raw.type_info().name() {
                _ if raw.is_null() => $crate::engine::Value::Int(None),
                $int => $crate::engine::Value::Int(Some(row.try_get(place)?)),
                $text => $crate::engine::Value::Text(Some(row.try_get(place)?)),
                $id => $crate::engine::Value::Id(Some(row.try_get(place)?)),
                _ => {
                    return Err($crate::error::JobError::UnexpectedValue(
                        column.name().to_owned(),
                    ));
                }
            };
            columns.push((column.name().to_owned(), value));
        }
        Ok($crate::engine::Row::new(columns))
    }};
}
pub(crate) use decoded;
