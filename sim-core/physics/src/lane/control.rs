//! Control flow of an execution context: the macros that code over [`Cx`](super::Cx) is written with.

/// `each!(cx, row in list, { … })`: the body for every row of the list.
#[macro_export]
macro_rules! each {
    ($cx:ident, $row:ident in $list:expr, $body:block) => {{
        let mut rows = $crate::lane::Cx::rows($cx, &$list);
        while let Some($row) = $crate::lane::Cx::next($cx, &mut rows) $body
    }};
}

/// `times!(cx, n, { … })` or `times!(cx, i in n, { … })`: at most `n` iterations; see [`break_if!`].
#[macro_export]
macro_rules! times {
    ($cx:ident, $i:ident in $n:expr, $body:block) => {{
        let mut rounds = $crate::lane::Cx::times($cx, $n);
        while let Some($i) = $crate::lane::Cx::next($cx, &mut rounds) $body
    }};
    ($cx:ident, $n:expr, $body:block) => {{
        let mut rounds = $crate::lane::Cx::times($cx, $n);
        while let Some(_) = $crate::lane::Cx::next($cx, &mut rounds) $body
    }};
}

/// `span!(cx, i in first, end, { … })`: the body for every index from `first` to before `end`.
#[macro_export]
macro_rules! span {
    ($cx:ident, $i:ident in $first:expr, $end:expr, $body:block) => {{
        let mut rounds = $crate::lane::Cx::span($cx, $first, $end);
        while let Some($i) = $crate::lane::Cx::next($cx, &mut rounds) $body
    }};
}

/// `push!(cx, list, mask, row, { … })`: a fresh row in the worlds of the mask, filled by the body.
#[macro_export]
macro_rules! push {
    ($cx:ident, $list:expr, $mask:expr, $row:ident, $body:block) => {{
        let (block, row) = $crate::lane::Cx::push($cx, &mut $list, $mask);
        if let Some($row) = row $body
        $crate::lane::Cx::leave($cx, block);
    }};
}

/// `when!(cx, mask, { … })`: the body in the worlds of the mask.
#[macro_export]
macro_rules! when {
    ($cx:ident, $mask:expr, $body:block) => {{
        let (block, any) = $crate::lane::Cx::enter($cx, $mask);
        if any $body
        $crate::lane::Cx::leave($cx, block);
    }};
}

/// `break_if!(cx, mask)`: ends the loop for the worlds of the mask. Only at the level of a loop
/// body, not inside a [`when!`].
#[macro_export]
macro_rules! break_if {
    ($cx:ident, $mask:expr) => {
        // `continue` reaches `next`, which closes the loop
        if $crate::lane::Cx::stop($cx, $mask) {
            continue;
        }
    };
}
