//! What the table of arrays is expanded to.

/// The scalars of an array, flat.
pub enum Flat<C, V> {
    /// Cells, which a stage may change in some worlds only.
    Cells(C),
    /// Values of all worlds.
    Values(V),
}

/// Defines `Block`, `Workspace`, `Array` and `Field` from the rows of `table.rs`.
macro_rules! arrays {
    ($m:ident;
     cells {$($c:ident: $cell:ident [$clen:expr] $cwriter:ident $cunit:literal
        $(=> $cpublic:literal $cgroup:ident [$($caxis:expr),*], $cdoc:literal)?;)*}
     values {$($v:ident: $value:ident [$velement:ident; $vlen:expr] $vwriter:ident $vunit:literal
        $(=> $vpublic:literal $vcommand:ident [$($vaxis:expr),*], $vdoc:literal)?;)*}
     work {$($w:ident: $work:ident [$welement:ident; $wlen:expr] $wwriter:ident $wunit:literal
        $(=> $wpublic:literal [$($waxis:expr),*], $wdoc:literal)?;)*}
     outputs {$($made:ident $public:literal $group:ident [$($axis:expr),*] $unit:literal $dtype:expr, $source:expr, $doc:literal;)*}
    ) => {
        /// An array of a block of worlds: a row of the table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Array {
            $(#[doc = concat!("[`Block::", stringify!($c), "`]")] $cell,)*
            $(#[doc = concat!("[`Block::", stringify!($v), "`]")] $value,)*
            $(#[doc = concat!("[`Workspace::", stringify!($w), "`]")] $work,)*
        }

        impl Array {
            /// Every array.
            pub const ALL: &'static [Array] = &[$(Array::$cell,)* $(Array::$value,)* $(Array::$work,)*];

            /// Its scalars, for a model.
            pub fn scalars<R: Real>(self, $m: &Constants<R>) -> usize {
                match self {
                    $(Array::$cell => $clen,)*
                    $(Array::$value => ($vlen) * <element::$velement<f32> as Element<f32>>::SCALARS,)*
                    $(Array::$work => ($wlen) * <element::$welement<f32> as Element<f32>>::SCALARS,)*
                }
            }

            /// Who writes it.
            pub const fn writer(self) -> Writer {
                match self {
                    $(Array::$cell => Writer::$cwriter,)*
                    $(Array::$value => Writer::$vwriter,)*
                    $(Array::$work => Writer::$wwriter,)*
                }
            }

            /// Its unit; `–` for none, or for several.
            pub const fn unit(self) -> &'static str {
                match self {
                    $(Array::$cell => $cunit,)*
                    $(Array::$value => $vunit,)*
                    $(Array::$work => $wunit,)*
                }
            }
        }

        /// A block of worlds at work. `F` is a scalar of every world, `V` a cell that a stage may change in some worlds only.
        pub struct Block<F, V> {
            $(#[doc = concat!("`[", stringify!($clen), "]` [", $cunit, "]")] pub $c: Vec<V>,)*
            $(#[doc = concat!("`[", stringify!($vlen), "]` [", $vunit, "]")] pub $v: Vec<element::$velement<F>>,)*
            /// What the stages leave for each other.
            pub work: Workspace<F>,
            /// Which part of its work a stage does that may pause.
            pub pause: Pause,
        }

        /// Results and scratch of the stages.
        pub struct Workspace<F> {
            $(#[doc = concat!("`[", stringify!($wlen), "]` [", $wunit, "]")] pub $w: Vec<element::$welement<F>>,)*
        }

        impl<F: Num, V: Copy> Block<F, V> {
            /// Arrays for a model: every scalar 0, every cell a copy of `cell`; parameters as worlds start from them.
            // arrays that stand for tables have no entries
            #[allow(clippy::zero_repeat_side_effects)]
            pub fn new<R: Real>($m: &Constants<R>, cell: V) -> Self {
                let mut block = Block {
                    $($c: vec![cell; $clen],)*
                    $($v: vec![<element::$velement<F> as Element<F>>::zero(); $vlen],)*
                    work: Workspace {
                        $($w: vec![<element::$welement<F> as Element<F>>::zero(); $wlen],)*
                    },
                    pause: Pause::default(),
                };
                for (param, (_, start)) in block.params.iter_mut().zip($m.varying.starts()) {
                    *param = F::c(*start);
                }
                block
            }

            /// The scalars of an array.
            pub fn array(&self, array: Array) -> Flat<&[V], &[F]> {
                match array {
                    $(Array::$cell => Flat::Cells(&self.$c),)*
                    $(Array::$value => Flat::Values(Element::flat(&self.$v)),)*
                    $(Array::$work => Flat::Values(Element::flat(&self.work.$w)),)*
                }
            }

            /// The scalars of an array, to be written.
            pub fn array_mut(&mut self, array: Array) -> Flat<&mut [V], &mut [F]> {
                match array {
                    $(Array::$cell => Flat::Cells(&mut self.$c),)*
                    $(Array::$value => Flat::Values(Element::flat_mut(&mut self.$v)),)*
                    $(Array::$work => Flat::Values(Element::flat_mut(&mut self.work.$w)),)*
                }
            }
        }

        /// A field of every world: what clients write and read.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Field {
            $($(#[doc = $cdoc] $cell,)?)*
            $($(#[doc = $vdoc] $value,)?)*
            $($(#[doc = $wdoc] $work,)?)*
            $(#[doc = $doc] $made,)*
        }

        impl Field {
            /// All fields, in order.
            pub const ALL: &'static [Field] = &[
                $($({ let _ = $cpublic; Field::$cell },)?)*
                $($({ let _ = $vpublic; Field::$value },)?)*
                $($({ let _ = $wpublic; Field::$work },)?)*
                $(Field::$made,)*
            ];

            /// Its row of the table.
            pub fn row(self) -> &'static FieldRow {
                use Axis::*;
                match self {
                    $($(Field::$cell => {
                        const ROW: FieldRow = FieldRow {
                            field: Field::$cell, name: $cpublic, group: Group::$cgroup, command: None, shape: &[$($caxis),*],
                            unit: $cunit, dtype: FieldDtype::Real, source: Source::Array(Array::$cell), doc: $cdoc,
                        };
                        &ROW
                    })?)*
                    $($(Field::$value => {
                        const ROW: FieldRow = FieldRow {
                            field: Field::$value, name: $vpublic, group: Group::Command, command: Some($vcommand), shape: &[$($vaxis),*],
                            unit: $vunit, dtype: FieldDtype::Real, source: Source::Array(Array::$value), doc: $vdoc,
                        };
                        &ROW
                    })?)*
                    $($(Field::$work => {
                        const ROW: FieldRow = FieldRow {
                            field: Field::$work, name: $wpublic, group: Group::Derived, command: None, shape: &[$($waxis),*],
                            unit: $wunit, dtype: FieldDtype::Real, source: Source::Array(Array::$work), doc: $wdoc,
                        };
                        &ROW
                    })?)*
                    $(Field::$made => {
                        #[allow(unused_imports)]
                        use Array::*;
                        const ROW: FieldRow = FieldRow {
                            field: Field::$made, name: $public, group: Group::$group, command: None, shape: &[$($axis),*],
                            unit: $unit, dtype: $dtype, source: $source, doc: $doc,
                        };
                        &ROW
                    })*
                }
            }
        }
    };
}

pub(super) use arrays;
