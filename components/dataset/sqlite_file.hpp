// A SQLite database with errors as values: what the bag reader and the bag writer stand on. Not for other folders.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "idl/bytes.hpp"
#include "idl/result.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace adit::dataset {

// A prepared statement. Parameters and columns count from 0; columns are valid until the next step().
class SqliteStatement {
 public:
  void bind(int parameter, std::int64_t value);
  void bind(int parameter, std::string_view value);
  // The bytes are not copied: they must not change before step().
  void bind(int parameter, Bytes value);
  // True: a row is there; false: the statement is done (and reset, ready for the next use).
  Result<bool> step();
  std::int64_t integer(int column) const;
  std::string text(int column) const;
  Bytes bytes(int column) const;

 private:
  friend class SqliteFile;
  struct Finalizer {
    void operator()(sqlite3_stmt* statement) const;
  };
  SqliteStatement(sqlite3* database, sqlite3_stmt* statement, std::string name)
      : database_(database), statement_(statement), name_(std::move(name)) {}
  sqlite3* database_;
  std::unique_ptr<sqlite3_stmt, Finalizer> statement_;
  std::string name_;
};

// One thread at a time. Statements must not outlive it.
class SqliteFile {
 public:
  // Reads an existing file without ever writing to it. A file whose writer was killed is read with the log it left; that
  // needs a folder that can be written to.
  static Result<SqliteFile> open_readonly(const std::string& path);
  // A new, empty file; one that exists is replaced.
  static Result<SqliteFile> create(const std::string& path);

  // Statements without result, separated by semicolons.
  Result<void> execute(const std::string& sql);
  Result<SqliteStatement> prepare(const std::string& sql);
  Result<bool> has_table(const std::string& table);
  Result<bool> has_column(const std::string& table, const std::string& column);

 private:
  struct Closer {
    void operator()(sqlite3* database) const;
  };
  SqliteFile(sqlite3* database, std::string path) : database_(database), path_(std::move(path)) {}
  Error failure() const;
  std::unique_ptr<sqlite3, Closer> database_;
  std::string path_;
};

}  // namespace adit::dataset
