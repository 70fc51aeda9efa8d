#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// Text in front of the variables of a version 5 file.
inline constexpr std::size_t kHeadBytes = 128;
/// Structures, cells and objects nested deeper are not followed.
inline constexpr int kDeepest = 20;

/// Description of a MATLAB object (table, timetable, datetime, string, ...) of this class; "" if unknown.
UnreadVariable unread_object(const std::string& name, const std::string& object_class);

/// The objects among the variables of a version 5 file, which libmatio reports without their names.
/// Source: MAT-File Format (MathWorks), array class 17 (opaque): flags, name, "MCOS", class.
std::vector<UnreadVariable> objects_of_v5(const std::filesystem::path& file);

/// Compares the arrays read from a version 7.3 file with its content; objects and function handles are added to
/// `list.unread`.
/// @throws FormatError naming a variable or a field that is in the file and could not be read
void require_all_of_v73(ArrayList& list);

}  // namespace stageid
