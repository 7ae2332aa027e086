#pragma once

#include "appearance/signature.h"
#include "observation/observation.h"

namespace omnifleet::appearance {

/// The signature of a place, in the sizes of its format: rows are averaged, modules and phases become bytes.
/// Per stored row first the bytes of the modules, then those of the phases.
StoredSignature store(const Signature& signature);

/// Signature with stored_rows rows: modules 1 … stored_modules, spectrum 1 … stored_phases (modules and
/// phases together). All columns count as seen. Throws std::invalid_argument if the sizes contradict the
/// format.
Signature restore(const SignatureFormat& format, const StoredSignature& stored);

/// Empty if the sizes of `stored` are those of the format and its numbers are finite; otherwise the reason.
std::string whyMalformed(const SignatureFormat& format, const StoredSignature& stored);

}  // namespace omnifleet::appearance
