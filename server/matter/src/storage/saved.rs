//! Trait objects in a saved state: each is written as its kind and its data.
//!
//! The whole state of a body can be written and read with serde, caches and history included, so that a body that
//! was read goes on with the same bits. Threads, flags and buffers without memory of their own are left out.

/// A module for `#[serde(with)]` that writes `$pointer<dyn $trait>` as one of the `$kind`s.
#[macro_export]
macro_rules! saved_as {
    ($module:ident, $pointer:ident, $object:path, $($kind:ident($type:ty)),+) => {
        /// How serde writes the trait object.
        pub mod $module {
            use std::any::Any;

            use serde::{Deserialize, Deserializer, Serialize, Serializer};

            use super::*;

            #[derive(Serialize)]
            enum Written<'a> { $($kind(&'a $type)),+ }

            #[derive(Deserialize)]
            enum Read { $($kind(Box<$type>)),+ }

            /// Writes its kind and its data.
            pub fn serialize<S: Serializer>(object: &$pointer<dyn $object>, to: S) -> Result<S::Ok, S::Error> {
                let any: &dyn Any = &**object;
                $(if let Some(known) = any.downcast_ref::<$type>() {
                    return Written::$kind(known).serialize(to);
                })+
                Err(serde::ser::Error::custom(concat!("a kind of ", stringify!($object), " that cannot be saved")))
            }

            /// Reads what `serialize` wrote.
            pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<$pointer<dyn $object>, D::Error> {
                Ok(match Read::deserialize(from)? { $(Read::$kind(known) => $pointer::new(*known)),+ })
            }
        }
    };
}
pub use crate::saved_as;

/// Arrays longer than serde knows, in a list: one list of all entries.
pub mod arrays {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes one list.
    pub fn serialize<S: Serializer, T: Serialize, const N: usize>(
        arrays: &[[T; N]],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        arrays.as_flattened().serialize(to)
    }

    /// Reads one list; its length must be a multiple of N.
    pub fn deserialize<'de, D: Deserializer<'de>, T: Deserialize<'de> + Clone, const N: usize>(
        from: D,
    ) -> Result<Vec<[T; N]>, D::Error> {
        let entries = Vec::<T>::deserialize(from)?;
        let (arrays, rest) = entries.as_chunks::<N>();
        if !rest.is_empty() {
            return Err(D::Error::custom("a list of arrays ends within an array"));
        }
        Ok(arrays.to_vec())
    }
}

/// One array longer than serde knows: a list.
pub mod array {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes a list.
    pub fn serialize<S: Serializer, T: Serialize, const N: usize>(
        array: &[T; N],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        array.as_slice().serialize(to)
    }

    /// Reads a list of N entries.
    pub fn deserialize<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
        from: D,
    ) -> Result<[T; N], D::Error> {
        let entries = Vec::<T>::deserialize(from)?;
        entries.try_into().map_err(|_| D::Error::custom("an array of another length"))
    }
}
