#include "components/dataset/sqlite_file.hpp"

#include <sqlite3.h>

#include <filesystem>

namespace adit::dataset {

void SqliteStatement::Finalizer::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}
void SqliteFile::Closer::operator()(sqlite3* database) const {
  sqlite3_close_v2(database);
}

void SqliteStatement::bind(int parameter, std::int64_t value) {
  sqlite3_bind_int64(statement_.get(), parameter + 1, value);
}
void SqliteStatement::bind(int parameter, std::string_view value) {
  sqlite3_bind_text64(statement_.get(), parameter + 1, value.data(), value.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
}
void SqliteStatement::bind(int parameter, Bytes value) {
  sqlite3_bind_blob64(statement_.get(), parameter + 1, value.data(), value.size(), SQLITE_STATIC);
}

Result<bool> SqliteStatement::step() {
  const int status = sqlite3_step(statement_.get());
  if (status == SQLITE_ROW) return true;
  sqlite3_reset(statement_.get());
  if (status == SQLITE_DONE) return false;
  const bool damaged = status == SQLITE_CORRUPT || status == SQLITE_NOTADB;
  return Error{damaged ? ErrorCode::malformed : ErrorCode::io, name_ + ": " + sqlite3_errmsg(database_)};
}

std::int64_t SqliteStatement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}
std::string SqliteStatement::text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  return text == nullptr ? std::string() : std::string(text);
}
Bytes SqliteStatement::bytes(int column) const {
  const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(statement_.get(), column));
  return {data, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

Error SqliteFile::failure() const {
  return Error{ErrorCode::io, path_ + ": " + sqlite3_errmsg(database_.get())};
}

Result<SqliteFile> SqliteFile::open_readonly(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) return Error{ErrorCode::not_found, path + ": no such file"};
  sqlite3* database = nullptr;
  const int status = sqlite3_open_v2(path.c_str(), &database, SQLITE_OPEN_READONLY, nullptr);
  SqliteFile file(database, path);
  if (status != SQLITE_OK) return file.failure();
  return file;
}

Result<SqliteFile> SqliteFile::create(const std::string& path) {
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
  for (const char* left_over : {"-journal", "-wal", "-shm"}) std::filesystem::remove(path + left_over, ignored);
  sqlite3* database = nullptr;
  const int status = sqlite3_open_v2(path.c_str(), &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  SqliteFile file(database, path);
  if (status != SQLITE_OK) return file.failure();
  return file;
}

Result<void> SqliteFile::execute(const std::string& sql) {
  if (sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) return failure();
  return {};
}

Result<SqliteStatement> SqliteFile::prepare(const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &statement, nullptr) != SQLITE_OK) return failure();
  return SqliteStatement(database_.get(), statement, path_);
}

Result<bool> SqliteFile::has_table(const std::string& table) {
  auto statement = prepare("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?");
  if (!statement) return statement.error();
  statement->bind(0, std::string_view(table));
  return statement->step();
}

Result<bool> SqliteFile::has_column(const std::string& table, const std::string& column) {
  auto statement = prepare("SELECT 1 FROM pragma_table_info(?) WHERE name = ?");
  if (!statement) return statement.error();
  statement->bind(0, std::string_view(table));
  statement->bind(1, std::string_view(column));
  return statement->step();
}

}  // namespace adit::dataset
