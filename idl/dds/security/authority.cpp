#include "idl/dds/security/authority.hpp"

#include <algorithm>
#include <fstream>
#include <system_error>
#include <utility>

#include "core/process/temporary_folder.hpp"
#include "idl/dds/security/documents.hpp"
#include "idl/dds/security/identity.hpp"
#include "idl/dds/security/signed_document.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

fs::path key_in(const fs::path& folder) { return folder / "authority" / "key.pem"; }
fs::path certificate_in(const fs::path& folder) { return folder / "authority" / "cert.pem"; }

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw SecurityError("folder " + folder.string() + " cannot be made: " + error.message());
  }
}

// Hidden: `name` is to be no identity before it is whole.
TemporaryFolder fresh_folder(const fs::path& parent, const std::string& name) {
  try {
    return TemporaryFolder(parent / ("." + name + "."));
  } catch (const fs::filesystem_error& error) {
    throw SecurityError(parent.string() + " cannot be written: " + error.code().message());
  }
}

void put(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw SecurityError(to.string() + " cannot be written: " + error.message());
}

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << text;
  out.close();
  if (!out) throw SecurityError(file.string() + " cannot be written");
}

void require_name(const std::string& name) {
  constexpr const char* allowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
  constexpr std::size_t longest = 64;
  if (name.empty() || name.size() > longest || name == "authority" ||
      name.find_first_not_of(allowed) != std::string::npos) {
    throw SecurityError("'" + name +
                        "' cannot be the name of an identity: up to 64 letters, digits, '_' and "
                        "'-', and not 'authority'");
  }
}

}  // namespace

Authority::Authority(fs::path folder, Certificate certificate, PrivateKey key)
    : folder_(std::move(folder)), certificate_(std::move(certificate)), key_(std::move(key)) {}

Authority Authority::make(const fs::path& folder, int days) {
  if (fs::exists(key_in(folder))) {
    throw SecurityError(folder.string() +
                        " has an authority already; 'stillmap security add' makes more identities, "
                        "and a new authority needs another folder");
  }
  make_folder(folder);
  const TemporaryFolder fresh = fresh_folder(folder, "authority");
  const PrivateKey key = PrivateKey::make();
  const Certificate certificate =
      Certificate::make_authority(key, "Stillmap authority", Validity::days_from_now(days));
  key.write(fresh.path() / key_in(folder).filename());
  certificate.write(fresh.path() / certificate_in(folder).filename());
  put(fresh.path(), folder / "authority");
  return {folder, certificate, key};
}

Authority Authority::open(const fs::path& folder) {
  if (!fs::exists(certificate_in(folder))) {
    throw SecurityError(folder.string() + " has no authority; 'stillmap security init' makes one");
  }
  return {folder, Certificate::read(certificate_in(folder)), PrivateKey::read(key_in(folder))};
}

fs::path Authority::add(const std::string& name, const std::string& role, const Access& access,
                        const Validity& validity, bool replace) const {
  require_name(name);
  const fs::path identity_folder = folder_ / name;
  if (fs::exists(identity_folder) && !replace) {
    throw SecurityError(identity_folder.string() + " exists; --replace makes it anew");
  }
  const TemporaryFolder fresh = fresh_folder(folder_, name);
  const IdentityFiles files(fresh.path());
  const PrivateKey key = PrivateKey::make();
  const Certificate certificate = Certificate::issue(key, name, role, validity, certificate_, key_);
  const Permissions permissions{
      .subject = certificate.subject(), .validity = validity, .access = access};
  key.write(files.key);
  certificate.write(files.certificate);
  certificate_.write(files.identity_authority);
  certificate_.write(files.permissions_authority);
  write_text(files.governance, sign_document(governance_text(), certificate_, key_));
  write_text(files.permissions, sign_document(to_text(permissions), certificate_, key_));
  make_folder(identity_folder);
  // The folder itself stays, with its owner and mode.
  for (const fs::path& file : {files.key, files.certificate, files.identity_authority,
                               files.permissions_authority, files.governance, files.permissions}) {
    put(file, identity_folder / file.filename());
  }
  return identity_folder;
}

std::vector<fs::path> Authority::identities() const {
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() && name != "authority" && !name.starts_with('.')) {
      folders.push_back(entry.path());
    }
  }
  std::ranges::sort(folders);
  return folders;
}

fs::path Authority::key_file() const { return key_in(folder_); }

}  // namespace stillmap::dds
